// Files, words and warnings of the sub-commands.
#include "tools/command.h"

#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <utility>

namespace nurbs {

namespace {

// A pipe or a device, which is written into: a file in its place would take it away.
bool is_special(const std::string& file) {
  std::error_code error;
  return std::filesystem::is_other(std::filesystem::status(file, error));
}

}  // namespace

std::string format(const char* pattern, double value) {
  char text[64];
  std::snprintf(text, sizeof text, pattern, value);
  return text;
}

std::string format_box(const Vec3& extent) {
  return format("%.4g x ", extent[0]) + format("%.4g x ", extent[1]) + format("%.4g", extent[2]);
}

void write_whole(const std::string& file, const std::string& text) {
  if (is_special(file)) {
    std::ofstream out(file, std::ios::binary);
    out << text;
    out.close();
    if (!out) throw std::runtime_error("can't write " + file + ": " + std::strerror(errno));
    return;
  }
  const std::string draft = file + "." + std::to_string(getpid()) + ".tmp";
  std::ofstream out(draft, std::ios::binary);
  out << text;
  out.close();
  if (!out || std::rename(draft.c_str(), file.c_str()) != 0) {
    const std::string reason = std::strerror(errno);
    std::remove(draft.c_str());
    throw std::runtime_error("can't write " + file + ": " + reason);
  }
}

std::string ending(const std::string& file) {
  std::string out = std::filesystem::path(file).extension().string();
  for (char& c : out) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return out;
}

void check_output(const std::string& command, const std::string& input, const std::string& output) {
  constexpr const char* kOthers[] = {".stl",  ".obj", ".ply",  ".step", ".stp",
                                     ".iges", ".igs", ".brep", ".vtu",  ".png"};
  std::error_code error;
  if (std::filesystem::equivalent(input, output, error))
    throw UsageError(command + ": -o " + output + " is the input file, which it would replace");
  const std::string kind = ending(output);
  if (std::find(std::begin(kOthers), std::end(kOthers), kind) != std::end(kOthers))
    throw UsageError(command + ": -o " + output + " ends in " + kind +
                     ", but shape files are JSON: name it .json");
}

void print_warnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) std::fprintf(stderr, "WARNING: %s\n", warning.c_str());
}

double parse_unit(const std::string& command, const std::string& text) {
  for (const auto& [name, length] :
       {std::pair{"um", 1e-3}, {"mm", 1.0}, {"cm", 10.0}, {"m", 1e3}, {"in", 25.4}})
    if (text == name) return length;
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value >= 1e-9 && value <= 1e9))
    throw UsageError(command + ": --unit is '" + text +
                     "', must be um, mm, cm, m, in or 1e-9 to 1e9 millimetres");
  return value;
}

double parse_share(const std::string& option, const std::string& text, double most) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  std::string rest(end, text.data() + text.size());
  while (!rest.empty() && rest[0] == ' ') rest.erase(0, 1);
  if (error != std::errc() || (!rest.empty() && rest != "%"))
    throw UsageError(option + " '" + text + "' is not a share, as 1% or 0.01");
  if (rest == "%") value /= 100;
  if (!(value > 0 && value <= most))
    throw UsageError(option + " is " + text + ", must be > 0 and at most " + format("%g", 100 * most) + "%");
  return value;
}

}  // namespace nurbs
