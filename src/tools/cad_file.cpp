// B-spline patches from the faces of solids, and back, with Open CASCADE.
#include "tools/cad_file.h"

#if __has_include(<Standard_Version.hxx>)

#include <BRepBndLib.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeSolid.hxx>
#include <BRepBuilderAPI_Sewing.hxx>
#include <BRepCheck_Analyzer.hxx>
#include <BRepClass3d.hxx>
#include <BRepGProp.hxx>
#include <BRepLib.hxx>
#include <BRepMesh_IncrementalMesh.hxx>
#include <BRepTools.hxx>
#include <BRepTools_PurgeLocations.hxx>
#include <BRepTools_WireExplorer.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <Bnd_Box.hxx>
#include <GProp_GProps.hxx>
#include <Geom2d_Curve.hxx>
#include <GeomConvert.hxx>
#include <GeomLib_IsPlanarSurface.hxx>
#include <Geom_BSplineCurve.hxx>
#include <Geom_BSplineSurface.hxx>
#include <Geom_BezierCurve.hxx>
#include <Geom_BezierSurface.hxx>
#include <Geom_Conic.hxx>
#include <Geom_ElementarySurface.hxx>
#include <Geom_Line.hxx>
#include <Geom_Plane.hxx>
#include <Geom_RectangularTrimmedSurface.hxx>
#include <Geom_SweptSurface.hxx>
#include <Geom_TrimmedCurve.hxx>
#include <IGESControl_Reader.hxx>
#include <IGESData_GlobalSection.hxx>
#include <IGESData_IGESModel.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <Message_Printer.hxx>
#include <Poly_Triangulation.hxx>
#include <Resource_Manager.hxx>
#include <STEPControl_Controller.hxx>
#include <STEPControl_Reader.hxx>
#include <STEPControl_Writer.hxx>
#include <ShapeProcess_Context.hxx>
#include <Standard_Failure.hxx>
#include <StepRepr_RepresentationItem.hxx>
#include <TColStd_SequenceOfAsciiString.hxx>
#include <TCollection_HAsciiString.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_DataMapOfShapeInteger.hxx>
#include <TopTools_IndexedDataMapOfShapeListOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Compound.hxx>
#include <TransferBRep.hxx>
#include <Transfer_TransientProcess.hxx>
#include <XSControl_TransferReader.hxx>
#include <XSControl_WorkSession.hxx>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>

namespace nurbs {
namespace {

constexpr double kOnSide = 1e-6;       // of a face's parameter range: closer to a side of it is on it
constexpr int kCurveSamples = 8;       // of an edge, to see where it runs
constexpr double kFlat = 1e-11;        // of a face's distance from the origin and size: planar
constexpr double kSew = 1e-6;          // of a body's size: edges closer are one
constexpr double kLargestTurn = 0.2;   // rad, between the normals of neighbouring triangles
constexpr double kLeastExtent = 1e-3;  // mm: Open CASCADE takes points within 1e-7 mm for one

// Open CASCADE reports to the standard output; what went wrong is said by its status.
void silence() {
  Message::DefaultMessenger()->RemovePrinters(STANDARD_TYPE(Message_Printer));
}

Vec3 vector(const gp_Pnt& p) {
  return {p.X(), p.Y(), p.Z()};
}

// --- Faces to patches
// ---------------------------------------------------------------------------------------

struct Trimmed {  // a face, or body, that has no exact patches
  std::string why;
};

struct Side {  // of a patch: a B-spline curve
  int degree = 0;
  std::vector<double> knots;
  std::vector<Vec4> points;
};

Side side(const NurbsSurface& s, int edge) {
  Side out;
  const bool along_v = edge < 2;
  out.degree = along_v ? s.degree_v : s.degree_u;
  out.knots = along_v ? s.knots_v : s.knots_u;
  const int count = along_v ? s.size_v : s.size_u;
  for (int k = 0; k < count; ++k)
    out.points.push_back(along_v ? s.point(edge == 0 ? 0 : s.size_u - 1, k)
                                 : s.point(k, edge == 2 ? 0 : s.size_v - 1));
  return out;
}

Side straight(const Vec3& a, const Vec3& b) {
  return {1, {0, 0, 1, 1}, {Vec4(a[0], a[1], a[2], 1), Vec4(b[0], b[1], b[2], 1)}};
}

// The plane patch between a point and a curve.
NurbsSurface fan(const Vec3& center, const Side& rim) {
  NurbsSurface s;
  s.degree_u = rim.degree;
  s.degree_v = 1;
  s.knots_u = rim.knots;
  s.knots_v = {0, 0, 1, 1};
  s.size_u = static_cast<int>(rim.points.size());
  s.size_v = 2;
  for (const Vec4& p : rim.points) {
    s.points.push_back(p[3] * Vec4(center[0], center[1], center[2], 1));
    s.points.push_back(p);
  }
  return s;
}

NurbsSurface bilinear(const std::array<Vec3, 4>& corner) {  // in order round the outline
  NurbsSurface s = fan(Vec3::Zero(), straight(corner[0], corner[1]));
  s.points[0].head<3>() = corner[3];
  s.points[2].head<3>() = corner[2];
  return s;
}

NurbsSurface patch(const Handle(Geom_BSplineSurface) & b) {
  NurbsSurface s;
  s.degree_u = b->UDegree();
  s.degree_v = b->VDegree();
  s.size_u = b->NbUPoles();
  s.size_v = b->NbVPoles();
  for (int k = 1; k <= b->NbUKnots(); ++k)
    s.knots_u.insert(s.knots_u.end(), b->UMultiplicity(k), b->UKnot(k));
  for (int k = 1; k <= b->NbVKnots(); ++k)
    s.knots_v.insert(s.knots_v.end(), b->VMultiplicity(k), b->VKnot(k));
  for (int i = 1; i <= s.size_u; ++i)
    for (int j = 1; j <= s.size_v; ++j) {
      const gp_Pnt p = b->Pole(i, j);
      const double w = b->Weight(i, j);
      s.points.emplace_back(w * p.X(), w * p.Y(), w * p.Z(), w);
    }
  return s;
}

// Surfaces whose conversion is no approximation.
bool rational(const Handle(Geom_Curve) & curve) {
  if (const auto trimmed = Handle(Geom_TrimmedCurve)::DownCast(curve); !trimmed.IsNull())
    return rational(trimmed->BasisCurve());
  return curve->IsKind(STANDARD_TYPE(Geom_Conic)) || curve->IsKind(STANDARD_TYPE(Geom_Line)) ||
         curve->IsKind(STANDARD_TYPE(Geom_BSplineCurve)) || curve->IsKind(STANDARD_TYPE(Geom_BezierCurve));
}
bool rational(const Handle(Geom_Surface) & surface) {
  if (const auto swept = Handle(Geom_SweptSurface)::DownCast(surface); !swept.IsNull())
    return rational(swept->BasisCurve());
  return surface->IsKind(STANDARD_TYPE(Geom_ElementarySurface)) ||
         surface->IsKind(STANDARD_TYPE(Geom_BSplineSurface)) ||
         surface->IsKind(STANDARD_TYPE(Geom_BezierSurface));
}

Handle(Geom_Surface) surface_of(const TopoDS_Face& face) {
  Handle(Geom_Surface) s = BRep_Tool::Surface(face);
  while (s->IsKind(STANDARD_TYPE(Geom_RectangularTrimmedSurface)))
    s = Handle(Geom_RectangularTrimmedSurface)::DownCast(s)->BasisSurface();
  return s;
}

struct Rectangle {
  double lo[2], hi[2];
  bool same(double a, double b, int d) const { return std::abs(a - b) < kOnSide * (hi[d] - lo[d]); }
  // The side, numbered as in EdgeLink, that holds all points; -1 if none does.
  int side_of(const std::vector<gp_Pnt2d>& points) const {
    for (int edge = 0; edge < 4; ++edge) {
      const int d = edge < 2 ? 0 : 1;
      const double at = edge % 2 ? hi[d] : lo[d];
      if (std::all_of(points.begin(), points.end(),
                      [&](const gp_Pnt2d& p) { return same(p.Coord(d + 1), at, d); }))
        return edge;
    }
    return -1;
  }
};

std::vector<gp_Pnt2d> parameter_curve(const TopoDS_Edge& edge, const TopoDS_Face& face) {
  double first = 0, last = 0;
  const Handle(Geom2d_Curve) curve = BRep_Tool::CurveOnSurface(edge, face, first, last);
  std::vector<gp_Pnt2d> points;
  for (int k = 0; !curve.IsNull() && k <= kCurveSamples; ++k)
    points.push_back(curve->Value(first + (last - first) * k / kCurveSamples));
  return points;
}

struct RectangularFace {
  NurbsSurface patch;
  std::vector<std::pair<TopoDS_Edge, int>> sides;  // edges that are one whole side
};

// Whether an edge or a wire bounds its face, and is not drawn on it inside.
bool bounds(const TopoDS_Shape& part) {
  return part.Orientation() == TopAbs_FORWARD || part.Orientation() == TopAbs_REVERSED;
}

// The patch of a face whose outline is a rectangle of its parameters; nothing if it is not.
std::optional<RectangularFace> rectangular(const TopoDS_Face& face) {
  const Handle(Geom_Surface) surface = surface_of(face);
  if (!rational(surface)) return std::nullopt;
  struct Edge {
    TopoDS_Edge edge;
    std::vector<gp_Pnt2d> points;
  };
  std::vector<Edge> edges;
  for (TopExp_Explorer e(face, TopAbs_EDGE); e.More(); e.Next()) {
    const TopoDS_Edge edge = TopoDS::Edge(e.Current());
    if (!bounds(edge)) continue;
    std::vector<gp_Pnt2d> points = parameter_curve(edge, face);
    if (points.empty()) return std::nullopt;
    edges.push_back({edge, std::move(points)});
  }
  if (edges.empty()) return std::nullopt;
  Rectangle r{{1e300, 1e300}, {-1e300, -1e300}};
  for (const Edge& e : edges)
    for (const gp_Pnt2d& p : e.points)
      for (int d = 0; d < 2; ++d) {
        r.lo[d] = std::min(r.lo[d], p.Coord(d + 1));
        r.hi[d] = std::max(r.hi[d], p.Coord(d + 1));
      }
  // The surface's own bounds where they are meant.
  double bounds[2][2];
  surface->Bounds(bounds[0][0], bounds[0][1], bounds[1][0], bounds[1][1]);
  for (int d = 0; d < 2; ++d) {
    if (!(r.hi[d] - r.lo[d] > 0)) return std::nullopt;
    if (r.same(r.lo[d], bounds[d][0], d)) r.lo[d] = bounds[d][0];
    if (r.same(r.hi[d], bounds[d][1], d)) r.hi[d] = bounds[d][1];
    const bool periodic = d == 0 ? surface->IsUPeriodic() : surface->IsVPeriodic();
    const double period = !periodic ? 0 : d == 0 ? surface->UPeriod() : surface->VPeriod();
    if (periodic && r.same(r.hi[d] - r.lo[d], period, d)) r.hi[d] = r.lo[d] + period;
  }
  RectangularFace out;
  double covered[4] = {0, 0, 0, 0};
  for (const Edge& e : edges) {
    const int edge = r.side_of(e.points);
    if (edge < 0) return std::nullopt;
    const int along = edge < 2 ? 1 : 0;
    const double a = e.points.front().Coord(along + 1), b = e.points.back().Coord(along + 1);
    const double share = std::abs(b - a) / (r.hi[along] - r.lo[along]);
    covered[edge] += share;
    if (std::abs(share - 1) < kOnSide) out.sides.push_back({e.edge, edge});
  }
  for (double share : covered)  // 0: a pole without an edge
    if (share > 0 && std::abs(share - 1) > 2 * kOnSide) return std::nullopt;
  Handle(Geom_BSplineSurface) b = Handle(Geom_BSplineSurface)::DownCast(surface);
  const auto whole = [&](int d) { return r.lo[d] == bounds[d][0] && r.hi[d] == bounds[d][1]; };
  if (!b.IsNull() && whole(0) && whole(1) && !b->IsUPeriodic() && !b->IsVPeriodic() &&
      b->UMultiplicity(1) == b->UDegree() + 1 && b->VMultiplicity(1) == b->VDegree() + 1) {
    out.patch = patch(b);
  } else {
    b = GeomConvert::SurfaceToBSplineSurface(
        new Geom_RectangularTrimmedSurface(surface, r.lo[0], r.hi[0], r.lo[1], r.hi[1]));
    if (b->IsUPeriodic()) b->SetUNotPeriodic();
    if (b->IsVPeriodic()) b->SetVNotPeriodic();
    out.patch = patch(b);
  }
  return out;
}

// Whether all control points lie in the plane of three that span it well. Open CASCADE's own test of splines
// loses half the digits.
bool planar(const NurbsSurface& s) {
  std::vector<Vec3> points;
  for (const Vec4& p : s.points) points.emplace_back(p.head<3>() / p[3]);
  const auto farthest = [&](const auto& distance) {
    return *std::max_element(points.begin(), points.end(),
                             [&](const Vec3& a, const Vec3& b) { return distance(a) < distance(b); });
  };
  const Vec3 a = points[0], b = farthest([&](const Vec3&p) { return (p - a).norm(); });
  const Vec3 c = farthest([&](const Vec3& p) { return (p - a).cross(b - a).norm(); });
  const Vec3 normal = (b - a).cross(c - a).normalized();
  const double size = a.norm() + (b - a).norm();
  return std::all_of(points.begin(), points.end(),
                     [&](const Vec3& p) { return std::abs(normal.dot(p - a)) <= kFlat * size; });
}

bool planar(const TopoDS_Face& face) {
  const Handle(Geom_Surface) surface = surface_of(face);
  if (surface->IsKind(STANDARD_TYPE(Geom_Plane))) return true;
  if (surface->IsKind(STANDARD_TYPE(Geom_BSplineSurface)) ||
      surface->IsKind(STANDARD_TYPE(Geom_BezierSurface)))
    return planar(patch(GeomConvert::SurfaceToBSplineSurface(surface)));
  return GeomLib_IsPlanarSurface(surface, kFlat).IsPlanar();
}

// Sides of rectangular faces, by the edge that each is: one that stands in two places is two.
struct Sides {
  TopTools_DataMapOfShapeInteger numbers;
  std::vector<Side> sides;
  void add(const TopoDS_Edge& edge, Side side) {
    numbers.Bind(edge, static_cast<int>(sides.size()));
    sides.push_back(std::move(side));
  }
  const Side* find(const TopoDS_Edge& edge) const {
    return numbers.IsBound(edge) ? &sides[static_cast<size_t>(numbers.Find(edge))] : nullptr;
  }
};

// Patches of a plane face within one outline of straight edges and sides of other patches.
std::vector<NurbsSurface> plane_patches(const TopoDS_Face& face, const Sides& sides) {
  int wires = 0;
  for (TopExp_Explorer w(face, TopAbs_WIRE); w.More(); w.Next()) wires += bounds(w.Current());
  if (wires != 1) throw Trimmed{"a plane face has a hole"};
  std::vector<Side> outline;
  std::vector<Vec3> corners;
  bool straight_only = true;
  for (BRepTools_WireExplorer w(BRepTools::OuterWire(face), face); w.More(); w.Next()) {
    const TopoDS_Edge edge = w.Current();
    if (BRep_Tool::Degenerated(edge)) continue;
    corners.push_back(vector(BRep_Tool::Pnt(w.CurrentVertex())));
    double first = 0, last = 0;
    Handle(Geom_Curve) curve = BRep_Tool::Curve(edge, first, last);
    while (!curve.IsNull() && curve->IsKind(STANDARD_TYPE(Geom_TrimmedCurve)))
      curve = Handle(Geom_TrimmedCurve)::DownCast(curve)->BasisCurve();
    const bool line = !curve.IsNull() && curve->IsKind(STANDARD_TYPE(Geom_Line));
    straight_only = straight_only && line;
    if (const Side* known = sides.find(edge)) {
      outline.push_back(*known);
    } else if (line) {
      outline.push_back(straight(vector(BRep_Tool::Pnt(TopExp::FirstVertex(edge))),
                                 vector(BRep_Tool::Pnt(TopExp::LastVertex(edge)))));
    } else {
      throw Trimmed{"a plane face has a curved edge with a trimmed face"};
    }
  }
  if (straight_only && corners.size() == 4)
    return {bilinear({corners[0], corners[1], corners[2], corners[3]})};
  Vec3 center = Vec3::Zero();
  double weights = 0;
  for (const Side& s : outline)
    for (const Vec4& p : s.points) {
      center += p.head<3>();
      weights += p[3];
    }
  std::vector<NurbsSurface> out;
  for (const Side& s : outline) out.push_back(fan(center / weights, s));
  return out;
}

std::vector<NurbsSurface> exact_patches(const TopoDS_Shape& shell) {
  std::vector<NurbsSurface> out;
  std::vector<TopoDS_Face> planes;
  Sides sides;
  int trimmed = 0, faces = 0;
  for (TopExp_Explorer f(shell, TopAbs_FACE); f.More(); f.Next(), ++faces) {
    const TopoDS_Face face = TopoDS::Face(f.Current());
    if (surface_of(face)->IsKind(STANDARD_TYPE(Geom_Plane))) {
      planes.push_back(face);
    } else if (std::optional<RectangularFace> r = rectangular(face)) {
      for (const auto& [edge, number] : r->sides) sides.add(edge, side(r->patch, number));
      out.push_back(std::move(r->patch));
    } else if (planar(face)) {
      planes.push_back(face);
    } else {
      ++trimmed;
    }
  }
  if (trimmed > 0)
    throw Trimmed{std::to_string(trimmed) + " of " + std::to_string(faces) +
                  " faces are curved and trimmed otherwise than along their parameters"};
  for (const TopoDS_Face& face : planes)
    for (NurbsSurface& s : plane_patches(face, sides)) out.push_back(std::move(s));
  return out;
}

void scale_by(double scale, std::vector<NurbsSurface>& surfaces) {
  for (NurbsSurface& s : surfaces)
    for (Vec4& p : s.points) p.head<3>() *= scale;
}

// --- Files to solids
// ----------------------------------------------------------------------------------------

TriangleMesh triangles(const TopoDS_Shape& shell, double scale, double deflection) {
  BRepTools::Clean(shell);
  BRepMesh_IncrementalMesh(shell, deflection / scale, false, kLargestTurn);
  TriangleMesh mesh;
  for (TopExp_Explorer f(shell, TopAbs_FACE); f.More(); f.Next()) {
    TopLoc_Location where;
    const Handle(Poly_Triangulation) part = BRep_Tool::Triangulation(TopoDS::Face(f.Current()), where);
    if (part.IsNull()) throw ShapeError("a face can't be cut into triangles");
    const int offset = static_cast<int>(mesh.points.size()) - 1;
    for (int k = 1; k <= part->NbNodes(); ++k)
      mesh.points.push_back(scale * vector(part->Node(k).Transformed(where)));
    for (int k = 1; k <= part->NbTriangles(); ++k) {
      int a = 0, b = 0, c = 0;
      part->Triangle(k).Get(a, b, c);
      if (f.Current().Orientation() == TopAbs_REVERSED) std::swap(b, c);
      mesh.triangles.push_back({a + offset, b + offset, c + offset});
    }
  }
  return mesh;
}

CadSolid describe(const TopoDS_Shape& solid, double scale) {
  CadSolid out;
  TopoDS_Shape shell = solid;
  if (solid.ShapeType() == TopAbs_SOLID) {
    shell = BRepClass3d::OuterShell(TopoDS::Solid(solid));
    for (TopExp_Explorer s(solid, TopAbs_SHELL); s.More(); s.Next()) ++out.cavities;
    --out.cavities;
    if (shell.IsNull()) throw ShapeError("a solid has no outer shell");
  }
  for (TopExp_Explorer f(shell, TopAbs_FACE); f.More(); f.Next()) ++out.faces;
  Bnd_Box box;
  BRepBndLib::AddOptimal(shell, box, false, false);
  if (box.IsVoid()) throw ShapeError("a solid has no extent");
  out.extent = scale * (vector(box.CornerMax()) - vector(box.CornerMin()));
  try {
    out.exact = exact_patches(shell);
    scale_by(scale, *out.exact);
  } catch (const Trimmed& trimmed) {
    out.trimmed = trimmed.why;
  } catch (const Standard_Failure& failure) {
    out.trimmed = std::string("Open CASCADE can't convert a face: ") + failure.DynamicType()->Name();
  }
  out.tessellate = [shell, scale](double deflection) {
    try {
      return triangles(shell, scale, deflection);
    } catch (const Standard_Failure& failure) {
      throw ShapeError(std::string("can't be cut into triangles: ") + failure.DynamicType()->Name());
    }
  };
  return out;
}

std::string step_name(const STEPControl_Reader& reader, const TopoDS_Shape& solid) {
  const Handle(XSControl_TransferReader) transfer = reader.WS()->TransferReader();
  const auto item = Handle(StepRepr_RepresentationItem)::DownCast(transfer->EntityFromShapeResult(solid, 1));
  return item.IsNull() || item->Name().IsNull() ? "" : item->Name()->ToCString();
}

std::string lower_ending(const std::string& file) {
  std::string ending = std::filesystem::path(file).extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return ending;
}

// The closed shells that free faces make when sewn; a face closed by itself, as a sphere is, is one too.
std::vector<TopoDS_Shape> sew(const std::vector<TopoDS_Shape>& faces) {
  Bnd_Box box;
  for (const TopoDS_Shape& face : faces) BRepBndLib::Add(face, box, false);
  const double size = box.IsVoid() ? 1 : std::sqrt(box.SquareExtent());
  BRepBuilderAPI_Sewing sewing(std::max(1e-7, kSew * size));
  for (const TopoDS_Shape& face : faces) sewing.Add(face);
  sewing.Perform();
  std::vector<TopoDS_Shape> shells;
  const TopoDS_Shape& sewn = sewing.SewedShape();
  const auto take = [&](const TopoDS_Shape& shell) {
    if (BRep_Tool::IsClosed(shell)) shells.push_back(shell);
  };
  for (TopExp_Explorer s(sewn, TopAbs_SHELL); s.More(); s.Next()) take(s.Current());
  for (TopExp_Explorer f(sewn, TopAbs_FACE, TopAbs_SHELL); f.More(); f.Next()) {
    TopoDS_Shell shell;
    BRep_Builder builder;
    builder.MakeShell(shell);
    builder.Add(shell, f.Current());
    take(shell);
  }
  return shells;
}

// Places that scale, which old BREP files have, are no longer allowed: the faces' parameters stay as they
// were.
TopoDS_Shape placed_rigidly(const TopoDS_Shape& content) {
  BRepTools_PurgeLocations places;
  return places.Perform(content) ? places.GetResult() : content;
}

std::vector<TopoDS_Shape> solids_in(const TopoDS_Shape& content) {
  std::vector<TopoDS_Shape> solids;
  for (TopExp_Explorer s(content, TopAbs_SOLID); s.More(); s.Next()) solids.push_back(s.Current());
  return solids;
}

std::vector<TopoDS_Shape> free_faces_in(const TopoDS_Shape& content) {
  std::vector<TopoDS_Shape> faces;
  for (TopExp_Explorer f(content, TopAbs_FACE, TopAbs_SOLID); f.More(); f.Next())
    faces.push_back(f.Current());
  return faces;
}

std::vector<CadSolid> solids_of(const TopoDS_Shape& content, double scale,
                                const std::function<std::string(const TopoDS_Shape&)>& name) {
  std::vector<CadSolid> out;
  for (const TopoDS_Shape& solid : solids_in(content)) {
    out.push_back(describe(solid, scale));
    out.back().name = name(solid);
  }
  const std::vector<TopoDS_Shape> faces = free_faces_in(content);
  int beside = static_cast<int>(faces.size());
  if (out.empty()) {
    if (faces.empty()) throw ShapeError("holds no solid and no face");
    for (const TopoDS_Shape& shell : sew(faces)) out.push_back(describe(shell, scale));
    for (const CadSolid& solid : out) beside -= solid.faces;
  }
  for (CadSolid& solid : out) solid.beside = beside;
  if (out.empty())
    throw ShapeError("holds no solid, and its " + std::to_string(faces.size()) + " faces enclose none");
  return out;
}

// What can't be in a file of that kind is not given to Open CASCADE, which takes almost anything.
void check_head(const std::string& file, const std::string& mark, const char* kind) {
  std::ifstream in(file, std::ios::binary);
  if (!in || std::filesystem::is_directory(file)) throw ShapeError("can't be read");
  std::string head(4096, '\0');
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<size_t>(in.gcount()));
  if (head.find(mark) == std::string::npos) throw ShapeError(std::string("is no ") + kind + " file");
}

// A spherical face with one outline lies to the left of it. Open CASCADE takes the part that the outline
// surrounds in the parameters, be it the other one, unless told to add the sphere's own bounds; that in turn
// spoils whole toruses.
void add_bounds_of_spheres(bool add) {
  STEPControl_Controller::Init();
  const Handle(Resource_Manager) settings = ShapeProcess_Context("STEP").ResourceManager();
  const auto set = [&](const char* name, const auto& value) {
    settings->SetResource((std::string("FromSTEP.") + name).c_str(), value);
  };
  set("exec.op", "FixShape");  // with what it does when there are no settings
  set("FixShape.Tolerance3d", "&Runtime.Tolerance");
  set("FixShape.MaxTolerance3d", "&Runtime.MaxTolerance");
  set("FixShape.CreateOpenSolidMode", 0);
  set("FixShape.FixSameParameterMode", 0);
  set("FixShape.FixAddNaturalBoundMode", add ? 1 : -1);
}

// The solids of two readings of a file: of the second those that are not sound in the first, and free faces.
TopoDS_Shape sound_ones(const TopoDS_Shape& first, const TopoDS_Shape& second) {
  const std::vector<TopoDS_Shape> a = solids_in(first), b = solids_in(second);
  if (a.size() != b.size()) return second;
  TopoDS_Compound out;
  BRep_Builder builder;
  builder.MakeCompound(out);
  for (size_t k = 0; k < a.size(); ++k) builder.Add(out, BRepCheck_Analyzer(a[k]).IsValid() ? a[k] : b[k]);
  for (const TopoDS_Shape& face : free_faces_in(second)) builder.Add(out, face);
  return out;
}

// All that a file holds.
TopoDS_Shape transfer(XSControl_Reader& reader, const std::string& file, const std::string& kind) {
  if (reader.ReadFile(file.c_str()) != IFSelect_RetDone)
    throw ShapeError("is damaged: " + kind + " can't be parsed");
  reader.TransferRoots();
  if (reader.NbShapes() == 0) throw ShapeError("holds no shape, or a damaged one");
  return reader.OneShape();
}

void name_unit(std::vector<CadSolid>& solids, const std::string& unit) {
  for (CadSolid& solid : solids) solid.unit = unit;
}

std::string step_unit(STEPControl_Reader& reader) {
  TColStd_SequenceOfAsciiString lengths, angles, solid_angles;
  reader.FileUnits(lengths, angles, solid_angles);
  return lengths.IsEmpty() ? "" : lengths.First().ToCString();
}

std::vector<CadSolid> read_step(const std::string& file, double scale) {
  check_head(file, "ISO-10303-21", "STEP");
  STEPControl_Reader with_bounds, without;
  add_bounds_of_spheres(true);
  TopoDS_Shape content = transfer(with_bounds, file, "STEP");
  if (!BRepCheck_Analyzer(content).IsValid()) {
    add_bounds_of_spheres(false);
    content = sound_ones(content, transfer(without, file, "STEP"));
  }
  std::vector<CadSolid> solids = solids_of(content, scale, [&](const TopoDS_Shape& solid) {
    const std::string name = step_name(with_bounds, solid);
    return name.empty() && without.NbShapes() > 0 ? step_name(without, solid) : name;
  });
  name_unit(solids, step_unit(with_bounds));
  return solids;
}

std::string no_name(const TopoDS_Shape&) {
  return "";
}

std::vector<CadSolid> read_iges(const std::string& file, double scale) {
  std::ifstream in(file, std::ios::binary);
  std::string line;
  if (!in || std::filesystem::is_directory(file)) throw ShapeError("can't be read");
  std::getline(in, line);
  if (line.size() < 73 || line[72] != 'S') throw ShapeError("is no IGES file");
  IGESControl_Reader reader;
  std::vector<CadSolid> solids = solids_of(transfer(reader, file, "IGES"), scale, no_name);
  const Handle(TCollection_HAsciiString) unit = reader.IGESModel()->GlobalSection().UnitName();
  if (!unit.IsNull()) name_unit(solids, unit->ToCString());
  return solids;
}

std::vector<CadSolid> read_brep(const std::string& file, double scale) {
  check_head(file, "CASCADE Topology", "BREP");
  TopoDS_Shape content;
  BRep_Builder builder;
  if (!BRepTools::Read(content, file.c_str(), builder) || content.IsNull())
    throw ShapeError("is damaged: BREP can't be parsed");
  return solids_of(placed_rigidly(content), scale, no_name);
}

// --- Shapes to files
// ----------------------------------------------------------------------------------------

Handle(Geom_BSplineSurface) spline(const NurbsSurface& s, double scale) {
  TColgp_Array2OfPnt poles(1, s.size_u, 1, s.size_v);
  TColStd_Array2OfReal weights(1, s.size_u, 1, s.size_v);
  for (int i = 0; i < s.size_u; ++i)
    for (int j = 0; j < s.size_v; ++j) {
      const Vec4& p = s.point(i, j);
      const Vec3 x = scale * p.head<3>() / p[3];
      poles(i + 1, j + 1) = gp_Pnt(x[0], x[1], x[2]);
      weights(i + 1, j + 1) = p[3];
    }
  std::array<std::vector<double>, 2> values;
  std::array<std::vector<int>, 2> counts;
  for (int d = 0; d < 2; ++d)
    for (double knot : d == 0 ? s.knots_u : s.knots_v) {
      if (values[d].empty() || knot != values[d].back()) {
        values[d].push_back(knot);
        counts[d].push_back(0);
      }
      ++counts[d].back();
    }
  const auto reals = [](const std::vector<double>& x) {
    return TColStd_Array1OfReal(x[0], 1, static_cast<int>(x.size()));
  };
  const auto integers = [](const std::vector<int>& x) {
    return TColStd_Array1OfInteger(x[0], 1, static_cast<int>(x.size()));
  };
  return new Geom_BSplineSurface(poles, weights, reals(values[0]), reals(values[1]), integers(counts[0]),
                                 integers(counts[1]), s.degree_u, s.degree_v);
}

// Clamped, and no knot inside where it may be creased, which Open CASCADE allows no face.
bool one_face(const NurbsSurface& s) {
  const auto fine = [](const std::vector<double>& knots, int degree) {
    int run = 0;
    for (size_t k = 0; k < knots.size(); ++k) {
      run = k > 0 && knots[k] == knots[k - 1] ? run + 1 : 1;
      const bool end = knots[k] == knots.front() || knots[k] == knots.back();
      if (!end && run >= degree) return false;
    }
    return knots[static_cast<size_t>(degree)] == knots.front() &&
           knots[knots.size() - 1 - static_cast<size_t>(degree)] == knots.back();
  };
  return fine(s.knots_u, s.degree_u) && fine(s.knots_v, s.degree_v);
}

std::vector<NurbsSurface> faces_of(const Shape& shape) {
  if (std::all_of(shape.surfaces.begin(), shape.surfaces.end(), one_face)) return shape.surfaces;
  std::vector<NurbsSurface> out;
  for (const NurbsSurface& surface : shape.surfaces)
    for (const BezierPiece& piece : split_to_bezier(surface))
      out.push_back(bezier_surface(piece.patch.degree_u, piece.patch.degree_v, piece.patch.points));
  return out;
}

double largest_gap(const Shape& shape) {
  double gap = 0;
  for (const auto& edges : shape.links)
    for (const EdgeLink& link : edges) gap = std::max(gap, link.gap);
  return gap;
}

TopoDS_Solid sewn_solid(const Shape& shape, double scale) {
  const double gap = 4 * scale * largest_gap(shape);
  BRepBuilderAPI_Sewing sewing(std::max({1e-7, kSew * scale * shape.bounding_radius, gap}));
  for (const NurbsSurface& s : faces_of(shape)) {
    BRepBuilderAPI_MakeFace face(spline(s, scale), 1e-7);
    if (!face.IsDone()) throw ShapeError("Open CASCADE can't make a face of a patch");
    sewing.Add(face.Face());
  }
  sewing.Perform();
  TopExp_Explorer shell(sewing.SewedShape(), TopAbs_SHELL);
  if (!shell.More() || !BRep_Tool::IsClosed(shell.Current()))
    throw ShapeError("Open CASCADE can't sew the patches into a closed solid");
  TopoDS_Solid solid = BRepBuilderAPI_MakeSolid(TopoDS::Shell(shell.Current())).Solid();
  if (!BRepLib::OrientClosedSolid(solid)) throw ShapeError("Open CASCADE can't tell inside from outside");
  return solid;
}

}  // namespace

std::vector<CadSolid> read_cad_file(const std::string& file, double scale) {
  silence();
  const std::string ending = lower_ending(file);
  try {
    if (ending == ".step" || ending == ".stp") return read_step(file, scale);
    if (ending == ".iges" || ending == ".igs") return read_iges(file, scale);
    if (ending == ".brep") return read_brep(file, scale);
    throw ShapeError("ending '" + ending + "' is not known, must be .step, .stp, .iges, .igs or .brep");
  } catch (const ShapeError& error) {
    throw ShapeError(file + ": " + error.what());
  } catch (const std::bad_alloc&) {
    throw ShapeError(file + ": is damaged or too large for the memory");
  } catch (const Standard_Failure& failure) {
    throw ShapeError(file + ": is damaged: Open CASCADE reports " + failure.DynamicType()->Name());
  }
}

double write_step_file(const Shape& shape, double scale, const std::string& file) {
  silence();
  try {
    const double extent = 2 * scale * shape.bounding_radius;
    if (!(extent >= kLeastExtent && extent <= 1e6))
      throw ShapeError("would be " + std::to_string(extent) +
                       " mm across, must be 0.001 to 1e6: choose another --unit");
    const TopoDS_Solid solid = sewn_solid(shape, scale);
    GProp_GProps mass;
    BRepGProp::VolumeProperties(solid, mass);
    STEPControl_Writer writer;
    if (writer.Transfer(solid, STEPControl_ManifoldSolidBrep) != IFSelect_RetDone ||
        writer.Write(file.c_str()) != IFSelect_RetDone)
      throw ShapeError("can't be written");
    return mass.Mass();
  } catch (const Standard_Failure& failure) {
    throw ShapeError(std::string("Open CASCADE reports ") + failure.DynamicType()->Name());
  }
}

}  // namespace nurbs

#else

namespace nurbs {
namespace {
[[noreturn]] void refuse(const std::string& prefix) {
  throw ShapeError(prefix +
                   "this nurbs-shape was built without Open CASCADE, which CAD files need: install "
                   "libocct-data-exchange-dev and libocct-modeling-algorithms-dev, and build again");
}
}  // namespace

std::vector<CadSolid> read_cad_file(const std::string& file, double) {
  refuse(file + ": ");
}
double write_step_file(const Shape&, double, const std::string&) {
  refuse("");
}

}  // namespace nurbs

#endif
