// Settings and styles of the host under which NURBS particles would move wrongly without a word.
#pragma once

#include <set>
#include <string>

#include "pointers.h"

namespace LAMMPS_NS::nurbs_host {

// Refuses, with one line that says what to use instead, or warns of them, of each once: `told` remembers the
// warnings. When a run begins, after the pair style's init. Collective.
void check_host(LAMMPS* lmp, std::set<std::string>* told);

// Whether fixes of this style are refused, and the line that does it if so. Collective.
bool is_refused_fix(const std::string& style);
void refuse_fix(LAMMPS* lmp, const char* style);

// Ends the run with the line for a pair style of the host's in the place of gran/nurbs. Collective.
[[noreturn]] void refuse_pair_style(LAMMPS* lmp);

}  // namespace LAMMPS_NS::nurbs_host
