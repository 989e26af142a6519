// Each array is streamed straight into base64: its size in bytes first (VTK's header), then its values.
#include "io/vtu_file.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <istream>
#include <iterator>
#include <ostream>

#include "io/vtk_bezier.h"

namespace nurbs {
namespace {

// Base64 (RFC 4648) of a stream of trivially copyable values.
class Base64Writer {
 public:
  explicit Base64Writer(std::ostream& out) : out_(out) {}

  template <typename T>
  void put(T value) {
    unsigned char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    for (unsigned char byte : bytes) put_byte(byte);
  }

  // Fills the last group of three bytes with zeros, shown as padding.
  void finish() {
    const int missing = (3 - held_) % 3;
    while (held_ != 0) put_byte(0, missing);
  }

 private:
  void put_byte(unsigned char byte, int padding = 0) {
    static const char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    group_ = (group_ << 8) | byte;
    if (++held_ < 3) return;
    char text[4];
    for (int k = 0; k < 4; ++k) text[k] = k >= 4 - padding ? '=' : kDigits[(group_ >> (18 - 6 * k)) & 63];
    out_.write(text, 4);
    held_ = 0;
    group_ = 0;
  }

  std::ostream& out_;
  std::uint32_t group_ = 0;
  int held_ = 0;
};

template <typename T>
const char* vtk_type();
template <>
const char* vtk_type<double>() {
  return "Float64";
}
template <>
const char* vtk_type<std::int64_t>() {
  return "Int64";
}
template <>
const char* vtk_type<std::int32_t>() {
  return "Int32";
}
template <>
const char* vtk_type<std::uint8_t>() {
  return "UInt8";
}

// One <DataArray> of `tuples` tuples; `fill(put)` hands every value to put(value).
template <typename T, typename Fill>
void data_array(std::ostream& out, const char* name, std::size_t tuples, int components, Fill fill) {
  out << "<DataArray type=\"" << vtk_type<T>() << "\" Name=\"" << name << "\" NumberOfComponents=\""
      << components << "\" NumberOfTuples=\"" << tuples << "\" format=\"binary\">\n";
  Base64Writer writer(out);
  writer.put(static_cast<std::uint64_t>(tuples * components * sizeof(T)));
  fill([&writer](T value) { writer.put(value); });
  writer.finish();
  out << "\n</DataArray>\n";
}

using Cells = std::vector<std::vector<VtkBezierCell>>;  // per shape, per patch

Cells make_cells(const std::vector<const Shape*>& shapes) {
  Cells cells(shapes.size());
  for (std::size_t s = 0; s < shapes.size(); ++s) {
    for (const BezierPatch& patch : shapes[s]->patches) cells[s].push_back(vtk_bezier_cell(patch));
  }
  return cells;
}

// The grid's cells in order: visit(body, cell, patch number).
template <typename Visit>
void for_each_cell(const std::vector<VtuBody>& bodies, const Cells& cells, Visit visit) {
  for (const VtuBody& body : bodies) {
    int patch = 0;
    for (const VtkBezierCell& cell : cells[body.shape]) visit(body, cell, patch++);
  }
}

struct Counts {
  std::size_t cells = 0, points = 0;
};

Counts count(const std::vector<VtuBody>& bodies, const Cells& cells) {
  Counts n;
  for_each_cell(bodies, cells, [&n](const VtuBody&, const VtkBezierCell& cell, int) {
    n.cells += 1;
    n.points += cell.points.size();
  });
  return n;
}

void write_points(std::ostream& out, const std::vector<VtuBody>& bodies, const Cells& cells,
                  const Counts& n) {
  out << "<PointData RationalWeights=\"RationalWeights\">\n";
  data_array<double>(out, "RationalWeights", n.points, 1, [&](auto put) {
    for_each_cell(bodies, cells, [&](const VtuBody&, const VtkBezierCell& cell, int) {
      for (double weight : cell.weights) put(weight);
    });
  });
  out << "</PointData>\n<Points>\n";
  data_array<double>(out, "Points", n.points, 3, [&](auto put) {
    for_each_cell(bodies, cells, [&](const VtuBody& body, const VtkBezierCell& cell, int) {
      const Mat3 turn = body.scale * body.orientation.toRotationMatrix();
      for (const Vec3& point : cell.points) {
        const Vec3 x = body.position + turn * point;
        for (int k = 0; k < 3; ++k) put(x[k]);
      }
    });
  });
  out << "</Points>\n";
}

void write_topology(std::ostream& out, const std::vector<VtuBody>& bodies, const Cells& cells,
                    const Counts& n) {
  out << "<Cells>\n";
  data_array<std::int64_t>(out, "connectivity", n.points, 1, [&](auto put) {
    for (std::size_t k = 0; k < n.points; ++k) put(static_cast<std::int64_t>(k));
  });
  data_array<std::int64_t>(out, "offsets", n.cells, 1, [&](auto put) {
    std::int64_t end = 0;
    for_each_cell(bodies, cells, [&](const VtuBody&, const VtkBezierCell& cell, int) {
      put(end += static_cast<std::int64_t>(cell.points.size()));
    });
  });
  data_array<std::uint8_t>(out, "types", n.cells, 1, [&](auto put) {
    for (std::size_t k = 0; k < n.cells; ++k) put(static_cast<std::uint8_t>(kVtkBezierQuadrilateral));
  });
  out << "</Cells>\n";
}

void write_cell_data(std::ostream& out, const std::vector<VtuBody>& bodies, const Cells& cells,
                     const Counts& n) {
  const auto integers = [&](const char* name, auto value) {
    data_array<std::int32_t>(out, name, n.cells, 1, [&](auto put) {
      for_each_cell(bodies, cells,
                    [&](const VtuBody& body, const VtkBezierCell&, int patch) { put(value(body, patch)); });
    });
  };
  const auto vectors = [&](const char* name, Vec3 VtuBody::*member) {
    data_array<double>(out, name, n.cells, 3, [&](auto put) {
      for_each_cell(bodies, cells, [&](const VtuBody& body, const VtkBezierCell&, int) {
        for (int k = 0; k < 3; ++k) put((body.*member)[k]);
      });
    });
  };
  out << "<CellData HigherOrderDegrees=\"HigherOrderDegrees\">\n";
  data_array<double>(out, "HigherOrderDegrees", n.cells, 3, [&](auto put) {
    for_each_cell(bodies, cells, [&](const VtuBody&, const VtkBezierCell& cell, int) {
      put(cell.degree_u);
      put(cell.degree_v);
      put(0);
    });
  });
  integers("id", [](const VtuBody& body, int) { return body.id; });
  integers("type", [](const VtuBody& body, int) { return body.type; });
  integers("shape", [](const VtuBody& body, int) { return body.shape + 1; });
  integers("patch", [](const VtuBody&, int patch) { return patch; });
  vectors("velocity", &VtuBody::velocity);
  vectors("omega", &VtuBody::omega);
  out << "</CellData>\n";
}

const char* byte_order() {
  const std::uint16_t one = 1;
  unsigned char first;
  std::memcpy(&first, &one, 1);
  return first == 1 ? "LittleEndian" : "BigEndian";
}

constexpr std::pair<char, const char*> kEscapes[] = {
    {'&', "&amp;"}, {'<', "&lt;"}, {'>', "&gt;"}, {'"', "&quot;"}};

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const auto* escape =
        std::find_if(std::begin(kEscapes), std::end(kEscapes), [c](const auto& e) { return e.first == c; });
    out += escape == std::end(kEscapes) ? std::string(1, c) : escape->second;
  }
  return out;
}

std::string unescaped(const std::string& text) {
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    const auto* escape = std::find_if(std::begin(kEscapes), std::end(kEscapes), [&](const auto& e) {
      return text.compare(at, std::strlen(e.second), e.second) == 0;
    });
    const bool is_one = escape != std::end(kEscapes);
    out += is_one ? escape->first : text[at];
    at += is_one ? std::strlen(escape->second) : 1;
  }
  return out;
}

}  // namespace

void write_vtu(std::ostream& out, const std::vector<VtuBody>& bodies, const std::vector<const Shape*>& shapes,
               double time) {
  const Cells cells = make_cells(shapes);
  const Counts n = count(bodies, cells);
  out << "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"2.2\" byte_order=\""
      << byte_order() << "\" header_type=\"UInt64\">\n<UnstructuredGrid>\n<FieldData>\n";
  data_array<double>(out, "TimeValue", 1, 1, [time](auto put) { put(time); });
  out << "</FieldData>\n<Piece NumberOfPoints=\"" << n.points << "\" NumberOfCells=\"" << n.cells << "\">\n";
  write_points(out, bodies, cells, n);
  write_topology(out, bodies, cells, n);
  write_cell_data(out, bodies, cells, n);
  out << "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
}

void write_pvd(std::ostream& out, const std::vector<std::pair<double, std::string>>& entries) {
  out << "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"" << byte_order()
      << "\">\n<Collection>\n";
  out.precision(17);
  for (const auto& [time, file] : entries) {
    out << "<DataSet timestep=\"" << time << "\" part=\"0\" file=\"" << escaped(file) << "\"/>\n";
  }
  out << "</Collection>\n</VTKFile>\n";
}

std::vector<std::pair<double, std::string>> read_pvd(std::istream& in) {
  constexpr char before_time[] = "<DataSet timestep=\"", before_file[] = "file=\"";
  std::vector<std::pair<double, std::string>> entries;
  for (std::string line; std::getline(in, line);) {
    const std::size_t file = line.find(before_file);
    if (line.rfind(before_time, 0) != 0 || file == std::string::npos) continue;
    const std::size_t begin = file + std::strlen(before_file), end = line.find('"', begin);
    if (end == std::string::npos) continue;
    entries.emplace_back(std::strtod(line.c_str() + std::strlen(before_time), nullptr),
                         unescaped(line.substr(begin, end - begin)));
  }
  return entries;
}

}  // namespace nurbs
