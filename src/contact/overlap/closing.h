// What searches over the directions of an overlap have in common when they close a part of the directions.
#pragma once

namespace nurbs {

constexpr double kClosedShare =
    0.9;  // of the tolerance, below the least overlap known, at which a part is closed
constexpr double kHopeless = 0.1;    // a search ends where less than this times its share of all is closed
constexpr double kCoreDepth = 0.98;  // of the overlap, by which bodies are cut to their cores
constexpr double kChord = 1.05;      // up to 0.5 rad: no less than an angle over its chord or sine

}  // namespace nurbs
