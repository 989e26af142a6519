// Pairs that nobody chose: random bodies of many kinds in random poses, most of them deep, nearly on one axis
// or centre, or of very different sizes, with truths by supports that share nothing with the solver. Shared
// by bench/deep_fuzz and its test.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "support/families.h"
#include "support/solids.h"

namespace nurbs::deep_fuzz {

// How two bodies are placed.
enum class Pose {
  deep,      // any overlap along any direction, down to full containment
  coaxial,   // nearly on one axis, anywhere along it
  centred,   // nearly on one centre, axes nearly parallel or not at all
  features,  // faces, vertices and rims of one against those of the other
  sizes,     // 1e2 to 1e6 : 1, at the larger body's surface or inside it
  saddles,   // stationary along a direction, about as deep as where it turns from a minimum to a saddle; one
             // time in two twins that are equally turned, or nearly, or mirrored
};
constexpr int kPoses = 6;
extern const char* const kPoseNames[kPoses];

struct Body {
  test::Solid solid;
  double accuracy = 2e-14;  // of its support, over the bounding radius
  bool cheap = true;        // a closed form
};

enum class Kinds {
  first,    // ellipsoids to 1000 : 1, cones, cylinders, capsules, lenses, polyhedra, boxes, rounded boxes and
            // polyhedra, tablets, eggs, bodies of one polar patch; and, with supports that are searched,
            // pebbles, biconvex tablets, kinked and blocky fits
  further,  // linear images of those in closed form, slices of spheres and of ellipsoids, conics of extreme
            // weights, Reuleaux bodies and prisms, sphericons, polyhedra of many faces or hardly rounded,
            // thin plates and rods; with searched supports, rounded profiles and fits of other exponents
};

// Of a seed, made once: `count` bodies, 20 to 100 ms each, of the kinds in turn.
class Fuzz {
 public:
  Fuzz(std::uint64_t seed, int count, Kinds kinds = Kinds::first);

  // Pair k of a kind of pose: the same for the same seed and count.
  families::PairCase pair(Pose pose, long k) const;
  // The least overlap over some thousand directions, the best of them refined: what can be found is no
  // truth, but no solver may be above it.
  families::Truth truth(const families::PairCase& pair, std::uint64_t seed) const;

  const Body& body_of(const Particle& p) const;

 private:
  std::uint64_t seed_;
  std::vector<Body> bodies_;
};

// What is wrong with an answer, in a word; empty: nothing. `truth` unset (gap -infinity): the answer is only
// held to its own normal.
struct Judgement {
  const char* wrong = "";
  double error = 0, allowed = 0;
};
Judgement judge(const Fuzz& fuzz, const families::PairCase& pair, const families::Truth& truth,
                const ContactResult& answer);

}  // namespace nurbs::deep_fuzz
