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

// Ends the run if this file is an STL text without its end: the host takes what there is for the whole mesh,
// or crashes. For the fix of this style and ID. Collective.
void check_stl(LAMMPS* lmp, const char* style, const char* id, const char* file);

// Ends the run with the line for a pair style of the host's in the place of gran/nurbs. Collective.
[[noreturn]] void refuse_pair_style(LAMMPS* lmp);

}  // namespace LAMMPS_NS::nurbs_host
