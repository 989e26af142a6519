// Every tolerance and cap of the support mapping and the contact search, with its scale and reason. Lengths
// are relative to a body's bounding radius unless said otherwise; slopes and angles are in radians.
#pragma once

namespace nurbs {

// Round-off of one support evaluation: a few ulp of the bounding radius.
constexpr double kRoundoff = 8e-16;

// --- joints
// ----------------------------------------------------------------------------------------------------
constexpr double kNoKink = 1e-7;  // angles between normals below this are no kink: the ball argument then
                                  // errs by less than kink^2 of the radius, which is round-off
constexpr double kSphere =
    1e-12;  // inner and bounding radius this close, relatively: a sphere, and treated as one
constexpr int kSpeedSamples = 8;  // per parameter, of a patch's parametric speed

// --- direction atlas
// -------------------------------------------------------------------------------------------
constexpr int kAtlasCells =
    16;  // per cube edge: the bound h is then loose by about (1/16)^2/8 of the curvature radius
constexpr int kAtlasSamples = 4;  // per patch and direction, to start the first searches from

// --- normal map
// -------------------------------------------------------------------------------------------
constexpr int kNormalCells = 64;           // per cube edge: cells 0.01 to 0.03 rad wide
constexpr double kNormalMargin = 0.01;     // rad around a normal for which the map's promise holds
constexpr double kLongRadius = 4;          // bounding radii
constexpr int kNormalQuads = 4;            // per patch parameter, to begin with ...
constexpr int kNormalDepth = 5;            // ... halved so often where normals spread ...
constexpr double kNormalQuadAngle = 0.02;  // ... by more than this, rad, or curvature radii ...
constexpr double kEvenRadius = 1.5;        // ... by more than this factor
constexpr int kNormalJointSamples = 64;    // along a kinked joint

// --- support mapping
// -------------------------------------------------------------------------------------------
constexpr int kSupportIterations = 60;  // 3 to 5 are usual; hops between patches count too
constexpr int kPolarRestarts = 4;       // times a search may leave a pole
constexpr double kSlopeTolerance =
    1e-14;  // d . tangent below this is a maximum: excess P slope^2 is far below round-off
constexpr double kSameSupport = 1e-6;       // points closer than this are one local maximum
constexpr double kStepTolerance = 1e-13;    // a step shorter than this is round-off
constexpr double kSufficientAscent = 1e-4;  // share of the gain a step's slope promises that it must bring
constexpr double kOnEdge = 1e-12;           // a parameter this near 0 or 1 is on the patch's edge
constexpr double kPoleMetric = 1e-26;  // |S_u|^2 this much smaller than |S_v|^2: at a pole, up to round-off
constexpr double kPoleOffset =
    1e-7;  // nearer to a pole than this (relative speed of the parameters) normals are lost
constexpr double kPoleNormal =
    1e-8;  // the same where the limit of the normal is at hand, which errs by as much
constexpr double kFlatHessian = 1e-12;  // Hessian determinants below this (times 1e-12) count as singular

// --- certificate
// --------------------------------------------------------------------------------------------------
constexpr double kLeastTolerance =
    6 * kRoundoff;  // of the larger radius: no bracket of the gap can be narrower
constexpr double kNoDirection =
    1e-10;  // a vector shorter than this, relative to the larger body, is mostly round-off

// --- joint Newton
// ----------------------------------------------------------------------------------------------
constexpr double kSingular = 1e-13;  // 2 x 2 determinant over the sum of its products' sizes
constexpr double kStationary =
    1e-10;  // angle between the normals, and offset across them over the smaller radius
constexpr double kLargestStep = 0.35;  // of a patch's parameter range in one Newton step
constexpr double kNormalTrust = 0.3;  // relative change of a tangent beyond which a step's normal is not used
constexpr double kNearPole =
    1e-4;  // ratio of the tangents' lengths below which a plane's warm solve hands on
constexpr int kWarmIterations = 4;     // 1 or 2 are usual
constexpr int kPolishIterations = 12;  // from a cold start

// --- local model
// ------------------------------------------------------------------------------------------------
constexpr int kRateSamples = 12;   // per patch parameter, of the inverse Weingarten map's rate of change
constexpr double kRateSafety = 2;  // on the largest rate seen between samples
constexpr double kRemainderSafety = 1.5;  // on the third-order remainder, for the fourth-order terms left out
constexpr double kRemainderShare = 0.1;   // of the bound on the maps' remainder that normals err by: rates
                                          // are the largest of a patch, doubled, and no turn meets them all
constexpr double kForceDepth = 1e-3;      // of the smaller radius: overlaps are right to the tolerance times
                                          // themselves, or times this if they are shallower
constexpr double kLocalDrift = 20;        // of the tolerance that the contact points may be off
constexpr double kRoomShare = 0.5;  // of the distance to the patch's edges that the contact point may move

// --- polytope method
// -------------------------------------------------------------------------------------------
constexpr int kHullVertices = 512;   // support pairs a fallback may spend; 20 to 80 are usual
constexpr int kHullFaces = 2048;     // twice the vertices, and room for those being replaced
constexpr int kHullAttempts = 5;     // from other directions, when round-off broke the hull
constexpr double kHullTurn = 0.2;    // between them
constexpr double kCoreShare = 0.5;   // of the smaller of the bodies' least curvature radii taken off, the
                                     // other wholly: more would leave two spheres no volume
constexpr double kRingRatio = 4;     // between the rings of directions about a deep minimum
constexpr double kWidestRing = 0.5;  // rad
constexpr double kSliver = 1e-13;  // triangles of the hull lower than this, relative to the larger body, have
                                   // no normal of their own
constexpr double kJoggle = 1e-11;  // the second hull's vertices move by this, relative to the larger body
constexpr double kFarAway = 1e300;  // larger than any length

// --- direction search (cold start)
// -------------------------------------------------------------------------------
constexpr int kScanCells = 4;       // per cube edge: 96 directions, 0.4 rad apart
constexpr int kScanMoves = 6;       // of the compass search per stride
constexpr double kDistinct = 0.75;  // cosine above which two guesses are in one basin
constexpr int kColdGuesses = 4;     // local minima tried when the overlap is deep

}  // namespace nurbs
