// Pairs and shapes that once failed, saved as files in tests/cases. Tests are run from anywhere: the files
// are found beside the sources.
#pragma once

#include <string>

namespace nurbs::test {

inline std::string case_file(const std::string& name) {
  std::string here = __FILE__;
  here.erase(here.rfind("support"));
  return here + "cases/" + name + ".json";
}

}  // namespace nurbs::test
