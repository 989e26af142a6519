// The machine's name, for the head of result files.
#pragma once

#include <time.h>

#include <algorithm>
#include <fstream>
#include <string>

namespace nurbs::bench {

// CPU model as /proc/cpuinfo words it, and the compiler.
inline std::string machine_name() {
  std::ifstream info("/proc/cpuinfo");
  std::string line, name = "unknown CPU";
  while (std::getline(info, line))
    if (line.rfind("model name", 0) == 0) {
      name = line.substr(line.find(':') + 2);
      break;
    }
  return name + "; g++ " __VERSION__;
}

// CPU time of this thread: other people's work on the machine does not count.
inline double thread_seconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}

// What two calls of it cost, to be taken off.
inline double clock_cost() {
  static const double cost = [] {
    double least = 1;
    for (int k = 0; k < 1000; ++k) {
      const double start = thread_seconds();
      least = std::min(least, thread_seconds() - start);
    }
    return least;
  }();
  return cost;
}

}  // namespace nurbs::bench
