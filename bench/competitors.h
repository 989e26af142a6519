// Every way to get a contact that the benchmarks compare, behind one interface: ours and the paper's solver,
// GJK+EPA libraries on meshes, and the cheap models in use today (best-fitting ellipsoid, sphere clumps).
#pragma once

#include <limits>
#include <memory>
#include <string>

#include "contact/contact.h"

namespace nurbs::bench {

struct Answer {
  bool ok = false;                                        // the method claims an answer
  double gap = std::numeric_limits<double>::quiet_NaN();  // > 0 apart (infinity: apart, distance not known),
                                                          // < 0 overlap depth
  Vec3 normal = Vec3::Zero();                             // unit, from A towards B, lab axes
  Vec3 point_a = Vec3::Zero(), point_b = Vec3::Zero();    // both relative to A's centre of mass, lab axes
};

// One instance serves one thread. Models of a shape are built when it is first seen.
class Method {
 public:
  virtual ~Method() = default;
  virtual std::string name() const = 0;
  // The geometry stands for the body only roughly, or to a mesh's error: worst over sampled directions of
  // |h - h of the model| / bounding radius; 0 for exact geometry.
  virtual double model_error(const Shape&) { return 0; }
  // Forgets what is known of the pair solved last. A warm method uses it in solve(); a cold one never keeps
  // any.
  virtual void begin_pair() {}
  virtual Answer solve(const Particle& a, const Particle& b) = 0;
};

// The ladder with reach infinity (full answers) or the paper's solver; `warm` keeps the pair's memory.
std::unique_ptr<Method> make_ours(double tolerance, bool warm);
std::unique_ptr<Method> make_cso(double tolerance, bool warm);

// libccd 2 (double precision), world coordinates: ccdGJKPenetration (GJK, then EPA to `tolerance`, a length)
// or ccdMPRPenetration on the mesh's support mapping. It knows of separated pairs only that they are apart.
enum class CcdAlgorithm { gjk_epa, mpr };
std::unique_ptr<Method> make_libccd(int vertices, CcdAlgorithm algorithm, double tolerance = 1e-6);

// FCL 0.7 (double precision), world coordinates: its own GJK and EPA (GST_INDEP) on fcl::Convex meshes;
// distances of separated pairs too. Its caps (255 iterations, 64 vertices, 128 faces) are left as they are:
// raised to 4,096 faces its answers were no better.
std::unique_ptr<Method> make_fcl(int vertices, double tolerance = 1e-6);

// Bullet 3 (double precision), world coordinates: btGjkEpaSolver2, whose accuracy of 1e-12 and cap of 128
// vertices are fixed when it is built; distances of separated pairs too.
std::unique_ptr<Method> make_bullet(int vertices);

// Ellipsoid of the same volume, centre and principal axes of inertia, solved by ours warm at 1e-9.
std::unique_ptr<Method> make_ellipsoid_fit();

// `spheres` balls inside the body that touch its surface at points spread far apart, each as large as fits;
// the contact is that of the sphere pair that overlaps most (or is nearest). Spheres out of the other body's
// bounding sphere are skipped first.
std::unique_ptr<Method> make_clump(int spheres);

// Worst |h - h of the mesh| over sampled directions, relative to the bounding radius.
struct Mesh;
double mesh_error(const Shape& shape, const Mesh& mesh);

}  // namespace nurbs::bench
