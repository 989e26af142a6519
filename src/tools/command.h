// What the sub-commands of nurbs-shape share.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "nurbs/types.h"

namespace nurbs {

struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Help that begins with how a command is called.
class Help : public CLI::Formatter {
 public:
  explicit Help(const std::string& usage) : usage_(usage) { column_width(26); }
  std::string make_description(const CLI::App*) const override { return ""; }
  std::string make_positionals(const CLI::App*) const override { return ""; }  // the usage names them
  std::string make_usage(const CLI::App* app, std::string) const override {
    return "usage: " + usage_ + "\n\n" + app->get_description() + "\n";
  }

 private:
  std::string usage_;
};

// A sub-command added to the program, and what it does once its arguments are parsed.
struct Command {
  CLI::App* parser;
  std::function<void()> run;
};
Command add_fit(CLI::App& app);
Command add_simplify(CLI::App& app);
Command add_import(CLI::App& app);
Command add_export(CLI::App& app);
Command add_view(CLI::App& app);

std::string format(const char* pattern, double value);
std::string format_box(const Vec3& extent);  // "1 x 2 x 3"

// Writes beside `file` and renames, so that `file` is whole or untouched; into it if it is a pipe or a
// device.
void write_whole(const std::string& file, const std::string& text);

// The ending of a file's name with its dot, in small letters.
std::string ending(const std::string& file);

// Throws UsageError that names `command` where a shape file can't go to `output`: it is the input file (if
// any), or is named as a mesh, a CAD file or a picture.
void check_output(const std::string& command, const std::string& input, const std::string& output);

// The millimetres of "mm", "cm", "m", "um", "in" or a number; throws UsageError that names `command`.
double parse_unit(const std::string& command, const std::string& text);

void print_warnings(const std::vector<std::string>& warnings);

// "1%", "1 %" or "0.01" as 0.01; throws UsageError that names `option` unless in (0, most].
double parse_share(const std::string& option, const std::string& text, double most);

}  // namespace nurbs
