// As src/precompiled.h, for the tests.
#include <gtest/gtest.h>
#include <precompiled.h>
