// Families of pairs that break contact solvers, each pair with the truth about it found without a contact
// solver, and the judge that compares an answer with it. Shared by the failure table and its test.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "contact/contact.h"
#include "support/random.h"

namespace nurbs::families {

using test::Random;  // every pair of a family has its own seed, so any one of them can be replayed alone

// What is known about a pair.
enum class Known {
  gap,    // the gap is `gap` up to round-off: by construction or a closed form
  bound,  // a direction was found along which the overlap is -gap: the true gap is at least `gap`; the search
          // for it was thorough, so equality is expected
};
struct Truth {
  Known known = Known::gap;
  double gap = 0;
  bool has_normal = false;  // whether there is only one right normal
  Vec3 normal = Vec3::Zero();
  double margin = 1e300;  // by which the next local minimum of p is deeper: a method less exact than that may
                          // take it for the least
};

struct PairCase {
  Particle a, b;
  double tolerance = 1e-9;
  bool warm = false;  // the pair is remembered from quite another pose
  Particle a_before, b_before;
  Truth truth;
  double rounded = 0;  // what the bodies may be off the truth's, a length: the digits of a file
  std::function<double(const Vec3&)>
      overlap;  // p(d) in closed form, d in the lab; unset: with the supports of src/
};

struct Family {
  const char* name;
  const char* what;
  long pairs;  // worth judging: 1e5 where the truth is cheap
  std::function<PairCase(Random&, long)> make;
};

const std::vector<Family>& all_families();
PairCase pair_of(const Family& family, long k);

// An answer as any method gives it.
struct Answer {
  bool given = true;        // false: the method said it failed
  bool unresolved = false;  // it gave a number it does not vouch for
  double gap = 0;
  bool has_normal = false;
  Vec3 normal = Vec3::Zero();  // from A towards B, lab
  int rung = 0;                // of the ladder, as Rung numbers them
  bool has_bracket = false;
  double lower = 0, upper = 0;
  bool has_points = false;
  Vec3 point_a = Vec3::Zero(), point_b = Vec3::Zero();  // from A's centre, lab
};

// Kinds of failure, worst first: an answer counts under the first that applies.
enum class Failure { none, no_answer, not_a_number, unresolved, sign, flipped, error, bracket, points };
constexpr int kFailures = 9;
extern const char* const kFailureNames[kFailures];

struct Verdict {
  Failure failure = Failure::none;
  double error = 0;    // of the gap
  double allowed = 0;  // tolerance and round-off of the pair's own numbers
};

// `mesh_error` (length): distance of the surfaces the method works on from the true ones, twice which it is
// allowed; 0 for methods that know the surfaces. Those are also held to p(normal) = -gap, to their bracket
// and to their contact points. A wrong sign counts only where both gaps are clear of zero by what is allowed.
Verdict judge(const PairCase& pair, const Answer& answer, double mesh_error = 0);

Answer solve(const PairCase& pair, Solver solver);

// The same by Newton side by side, going on from the default solver's answer where B stood before a small
// motion; `lane` is where. Not given where that leaves the pair to the ladder.
Answer follow(const PairCase& pair, int lane);

}  // namespace nurbs::families
