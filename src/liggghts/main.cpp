// liggghts-nurbs: the host's program with the NURBS styles linked in (see register.cpp); same command line.
#include <mpi.h>

#include <csignal>
#include <cstdio>

#include "input.h"
#include "lammps.h"
#include "signal_handling.h"

namespace {

// As in the host: interrupt or terminate ends the run after the current step with all output written, SIGUSR1
// asks for a restart file.
void install_signal_handlers() {
  struct sigaction interrupt = {}, restart = {};
  interrupt.sa_handler = LAMMPS_NS::SignalHandler::int_handler;
  restart.sa_handler = LAMMPS_NS::SignalHandler::usr1_handler;
  sigaction(SIGINT, &interrupt, nullptr);
  sigaction(SIGTERM, &interrupt, nullptr);  // what mpirun makes of an interrupt
  sigaction(SIGUSR1, &restart, nullptr);
}

}  // namespace

int main(int argc, char** argv) {
  // The host's errors end the program without a flush, and a pipe or a file would not see them.
  std::setvbuf(stdout, nullptr, _IOLBF, BUFSIZ);
  install_signal_handlers();
  MPI_Init(&argc, &argv);
  auto* lammps = new LAMMPS_NS::LAMMPS(argc, argv, MPI_COMM_WORLD);
  lammps->input->file();
  delete lammps;
  MPI_Finalize();
}
