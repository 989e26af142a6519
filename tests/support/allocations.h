// Counts what is allocated, for tests that promise not to.
#pragma once

namespace nurbs::test {

// Calls of operator new so far, by all threads.
long allocations();

}  // namespace nurbs::test
