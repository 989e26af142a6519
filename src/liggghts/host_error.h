// Errors and warnings of the NURBS styles, worded as one line, in the host's way.
#pragma once

#include <string>

#include "pointers.h"

namespace LAMMPS_NS {
class Fix;
}

namespace LAMMPS_NS::nurbs_host {

// Ends the run on every rank with exit status 1 and one line "ERROR: message". Collective: all ranks must
// call it. `file` and `line` are the host's FLERR.
[[noreturn]] void fail_all(const char* file, int line, LAMMPS* lmp, const std::string& message);

// The same, called by one rank alone (others are aborted). Unlike the host's error->one the line reads
// "ERROR: " and is flushed before the abort.
[[noreturn]] void fail_one(LAMMPS* lmp, const std::string& message);

// One line "WARNING: message" from rank 0; any rank may call it.
void warn(const char* file, int line, LAMMPS* lmp, const std::string& message);

// The same unless `last` is that message already; keeps it there.
void warn_news(const char* file, int line, LAMMPS* lmp, const std::string& message, std::string& last);

// A number as a message shows it: shortest form that tells the value.
std::string show(double value);

// "Fix STYLE ID", with which messages about a fix begin.
std::string name_of(const Fix& fix);

}  // namespace LAMMPS_NS::nurbs_host
