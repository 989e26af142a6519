// Errors and warnings of the NURBS styles. See host_error.h.
#include "liggghts/host_error.h"

#include <mpi.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "comm.h"
#include "error.h"
#include "fix.h"
#include "lammps.h"
#include "modify.h"

namespace LAMMPS_NS::nurbs_host {

void fail_all(const char* file, int line, LAMMPS* lmp, const std::string& message) {
  lmp->error->all(file, line, message.c_str());
  std::exit(1);  // not reached: error->all ends the program
}

void fail_one(LAMMPS* lmp, const std::string& message) {
  for (FILE* stream : {lmp->screen, lmp->logfile}) {
    if (stream == nullptr) continue;
    std::fprintf(stream, "ERROR: %s\n", message.c_str());
    std::fflush(stream);
  }
  MPI_Abort(lmp->world, 1);
  std::exit(1);
}

void warn(const char* file, int line, LAMMPS* lmp, const std::string& message) {
  if (lmp->comm->me == 0) lmp->error->warning(file, line, message.c_str());
}

void warn_news(const char* file, int line, LAMMPS* lmp, const std::string& message, std::string& last) {
  if (message != last) warn(file, line, lmp, message);
  last = message;
}

std::string show(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.10g", value);
  return text;
}

std::string name_of(const Fix& fix) {
  return std::string("Fix ") + fix.style + " " + fix.id;
}

}  // namespace LAMMPS_NS::nurbs_host
