// Every tolerance and cap of the making of bodies, the support mapping and the contact search, with its scale
// and reason, in the order they are met. Lengths are relative to a body's bounding radius unless said
// otherwise; slopes and angles are in radians, parameters in units of a patch's range.
//
// Elsewhere: what a paper's method asks for (reference/), fits (shapes/surface_fit.cpp), rotation (motion/).
#pragma once

namespace nurbs {

// Round-off of one support evaluation: a few ulp of the bounding radius.
constexpr double kRoundoff = 8e-16;

// --- a closed body
constexpr double kJoinTolerance = 1e-6;   // of the box's diagonal: gap between edges that count as joined
constexpr double kSameParameters = 1e-3;  // of it: two sides nearer at equal parameters have the same ones
constexpr int kEdgeSamples = 5;           // points at which two edge curves are first compared
constexpr int kProjectionSamples = 32;    // starts of the search for the closest point of a curve ...
constexpr int kProjectionSections = 45;   // ... then golden sections: 1/16 of the parameter to 3e-11
constexpr double kParameterRoundoff = 1e-12;  // a parameter that moves less has been found
constexpr int kKinkSamples = 17;              // points at which the normals of two sides are compared
constexpr double kJointSine = 0.01;      // sine between tangents below which normals are not compared ...
constexpr double kJointSineShare = 0.1;  // ... where it is larger elsewhere on the joint
constexpr double kPoleInset = 1e-4;      // parameters from a pole at which its normals are compared
constexpr double kLeastVolume = 1e-12;   // of the diagonal cubed: less is no body but a surface

// --- joints
constexpr double kNoKink = 1e-7;  // angles between normals below this are no kink, but take from the radii
                                  // of balls inside and around: body/small_kinks.h
constexpr double kSmoothKink = 1e-6;  // such bodies count as smooth: ignoring a kink moves a support by
                                      // kink^2/8, 1e-13 of the radius
constexpr double kSphere =
    1e-12;  // inner and bounding radius this close, relatively: a sphere, and treated as one
constexpr double kGapsCrossed = 4;        // joints whose gaps add up: four patches meet in a corner
constexpr double kJointTightness = 1.1;   // of a bound of a gap or a kink over one that occurs
constexpr double kJointRoundoff = 4e-15;  // of the body's size: gaps below are none
constexpr double kNegligibleKink = 1e-9;  // rad: bounds need not be tighter
constexpr int kJointHalvings = 8;         // of a joint, on the way there
constexpr int kProjectedPieces = 256;     // of a joint whose sides are paired point by point
constexpr double kVanishing = 1e-12;      // relative: coefficients below are zero
constexpr double kSmallKink = 0.1;        // rad: larger ones are edges, not imperfect joints

// --- mass
constexpr double kMomentTolerance = 1e-12;  // of each moment, per integration cell
constexpr double kUnevenWeights = 10;  // ratio of a patch's ends, on average, from which it is integrated in
                                       // parameters in which they weigh the same
constexpr double kMomentRoundoff = 1e-13;  // relative: products of inertia and differences of moments below
                                           // this are none; integrated moments are good to some 1e-15
constexpr double kGivenAsymmetry = 1e-12;  // relative, of a gyration tensor given by the user
constexpr double kGivenExcess = 1e-9;      // by which its largest moment may exceed the sum of the others:
                                           // a rod's or plate's, written with ten digits

// --- radii
constexpr double kBoundWidth = 1e-6;          // of the squared radius, at which a bound is tight enough
constexpr int kMaxSplits = 4000;              // of patches, on the way there
constexpr double kBernsteinRoundoff = 1e-13;  // relative, of products and halvings of the coefficients

// --- curvature
constexpr int kSurfaceSamples = 3000;                // aimed at, over the body ...
constexpr int kLeastPerEdge = 4, kMostPerEdge = 24;  // ... and per patch parameter
constexpr double kSingularCross = 5e-5;  // |Su x Sv| over the middle's |Su| |Sv|: below, a point is singular.
                                         // Curvature loses the square of it in digits: about eight remain
constexpr double kInsets[] = {1e-4, 1e-3};  // parameters towards the middle, in turn, where it is looked at
                                            // instead
constexpr double kCurvatureNoise = 1e-9;    // over the bounding radius: curvatures up to this are round-off
constexpr double kRadiusTightness = 1.15;   // of proven curvature radii over ones that occur ...
constexpr double kRateTightness = 1.3;      // ... and of the rates of their change ...
constexpr double kRateFloor = 0.25;      // ... unless those are below this share of the patch's largest one
constexpr double kSmallRate = 0.02;      // ... or of the largest radius
constexpr double kUselessRate = 1e6;     // of the body's size: no local model would serve
constexpr int kRateCells = 8;            // per patch parameter, for which rates are kept
constexpr double kGridRoundoff = 1e-9;   // of such a cell: leaves' rims are known to this
constexpr double kEvenWeights = 1e-9;    // ratios of weights this near 1 are left as they are
constexpr double kPoleStrip = 0.0625;    // of a patch's parameter, at a pole, where no rate is proven
constexpr int kMostCells = 16000;        // enclosed for a body's radii ...
constexpr int kMostRateCells = 5000;     // ... and for its rates ...
constexpr int kMostCellsPerPatch = 150;  // ... and so many more for each of its patches
constexpr int kDeepestCell = 40;         // halvings of a patch
constexpr int kDeepestUnproven = 24;     // ... of a cell that is not proven convex
constexpr double kWideCone = 0.5;        // rad, of a cell's normals: both ways to halve it are tried
constexpr double kLittleDoubt = 1;  // ... unless its tangents and normals vary less than this, relatively
constexpr double kLeastNormalCell = 1e-5;  // of a patch's parameters: halved no more for the normal map
constexpr double kNetRoundoff = 2e-15;     // of a coefficient of a cell's net, over the largest
constexpr int kCubicAngles = 16;           // at which the third-order form is looked at in half a turn

// --- dents
constexpr double kAllowedDent = 1e-3;      // deeper is no convex body; up to this, a dent is left to the hull
constexpr double kUnmentionedDent = 1e-6;  // deeper is worth a warning
constexpr double kNoDent = 1e-13;          // round-off of a difference of supports
constexpr double kHollowNoise = 2e-13;  // over the bounding radius: hollows of less curvature are no deeper
constexpr int kPairsIfConvex = 1200, kPairsIfDented = 4000;  // samples compared with each other
constexpr int kDentStarts = 1000;         // samples from which the best start of a support is taken
constexpr double kWidestTilt = 2;         // tangent of the largest tilt of that plane against the surface
constexpr int kMostCuts = 30;             // supports spent on one depth ...
constexpr double kDepthTolerance = 1e-3;  // ... or until it is known to this, relatively
constexpr int kPlaceRounds = 5;           // halvings of the sample step in the search for the deepest point

// --- direction atlas
constexpr int kAtlasCells =
    16;  // per cube edge: the bound h is then loose by about (1/16)^2/8 of the curvature radius
constexpr int kAtlasSamples = 4;  // per patch and direction, to start the first searches from

// --- normal map
constexpr int kNormalCells = 64;        // per cube edge: cells 0.01 to 0.03 rad wide
constexpr double kNormalMargin = 0.01;  // rad around a normal for which the map's promise holds
constexpr double kLongRadius = 4;       // bounding radii
constexpr double kRoundLeafAngle =
    0.035;  // rad: leaves are halved until their normals are as close together ...
constexpr double kFlatLeafAngle = 0.02;  // ... flat and dented ones, whose radius is infinite, as these ...
constexpr int kMostNormalCells = 20000;  // ... and these many are enclosed, or their radii differ ...
constexpr double kEvenRadius = 2;        // ... by more than this factor
constexpr int kNormalJointSamples = 64;  // along a kinked joint
constexpr double kNormalCap = 0.2;       // widest cap of directions painted, rad
constexpr double kJointCapSafety = 1.5;  // on the angle between the sides of a joint, which varies along it

// --- ellipsoids
constexpr double kEllipsoidGuess = 1e-3;  // relative: how far off the moments' semi-axes may be
constexpr double kEllipsoid =
    5e-11;  // relative: a body this near an ellipsoid is one, where the tolerance allows

// --- bodies of revolution
constexpr double kArcError = 1e-10;       // of the body's size: what arcs about the axis may be off by ...
constexpr double kExactTurn = 1e-14;      // ... where that is more than round-off ...
constexpr double kNearRevolution = 1e-4;  // ... and of rippled bodies, from files of few digits,
constexpr double kNearKink = 1e-4;        // rad: whose profiles' pieces are in line up to that

// --- meridians
constexpr double kMeridianError = 1e-10;   // of the body's size: patches this near a profile times an arc
constexpr double kMeridianSame = 3.2e-15;  // ... are that to round-off if in all they are no further from it
constexpr double kMeridianOver = 1e-9;     // rad, parameters: overlap of the patches round the axis
constexpr int kMeridianStarts = 64;        // directions of its table
constexpr int kMeridianSteps = 16;         // of Newton; 2 to 4 are usual
constexpr double kMeridianSlope = 0.1;     // of a support's round-off: what is left to gain
constexpr double kMeridianStep = 1e-7;     // of the body's size: Newton's next place is not evaluated
constexpr int kMeridianHalvings = 20;      // of a step that does not ascend
constexpr int kMeridianDepth = 40;         // of bisection
constexpr double kMeridianEnd = 1e-3;      // parameter: a maximum this near an end splits no piece
constexpr double kMeridianTurn = 1e-14;    // parameter: step round the axis that is round-off

constexpr int kProfileCells = 1024;     // of their normals, a cell being some 2 to 4 mrad
constexpr double kProfileKink = 2e-14;  // rad: normals that are one

// --- support mapping
constexpr int kSupportIterations = 60;  // 3 to 5 are usual; hops between patches count too
constexpr double kSlopeTolerance =
    1e-14;  // d . tangent below this is a maximum: excess P slope^2 is far below round-off
constexpr double kSameSupport = 1e-6;       // points closer than this are one local maximum
constexpr double kStepTolerance = 1e-13;    // a step shorter than this is round-off
constexpr double kSufficientAscent = 1e-4;  // share of the gain a step's slope promises that it must bring
constexpr double kOnEdge = 1e-12;           // a parameter this near 0 or 1 is on the patch's edge
constexpr double kPoleMetric = 1e-26;    // |S_u|^2 this much smaller than |S_v|^2: at a pole, up to round-off
constexpr double kPoleNormal = 1e-8;     // nearer to a pole than this (relative speed of the parameters) its
                                         // normal is taken from the limit, which errs by as much
constexpr double kPoleSpreadSafety = 4;  // times what a collapsed edge spreads, tangents may be off by
constexpr double kPoleSpeed = 1e-6;      // root of |Su x Sv| over the bounding radius, and ...
constexpr double kLeastSine = 1e-4;      // ... sine between the tangents, below which a normal is no proof
constexpr double kNormalNoise = 4e-16;   // round-off of a normal whose tangents are at right angles
constexpr double kTangentNoise = 4 * kRoundoff;  // of the body: round-off of a surface tangent
constexpr double kNormalLost = 1e-9;             // rad, of a normal's round-off: below, it does not count
constexpr double kFlatCurvature = 1e-12;   // over the bounding radius: a curvature below this says nothing
                                           // about how far to step
constexpr double kSingularMetric = 1e-24;  // square of the sine of the angle between the tangents, below
                                           // which only one of them is used
constexpr int kStepHalvings = 40;          // of a step that does not ascend: 1e-12 of it is left

// --- highest point of a patch
constexpr int kMaximumBoxes = 2000;     // of one patch; 3 to 30 are usual
constexpr int kMaximumDepth = 80;       // halvings: both parameters to round-off
constexpr double kConcaveShare = 1e-3;  // of the second derivatives that the mixed one must leave
constexpr int kConcaveSteps = 8;        // of Newton in a concave box
constexpr double kConcaveRest = 1e-6;   // of the slack: what the gradient left may hide
constexpr double kSupportSlack = 2;     // round-offs of a body that its support may lack
constexpr double kFeatureSupport =
    1e-13;  // of a body: what points of contact polygons, lines and edges may lack of its support

// --- where supports lie near dents
constexpr int kSupportCells = 64;             // per cube edge, as the normal map's
constexpr int kSupportPieces = 16;            // of a patch's parameters: pieces end at multiples of these
constexpr double kSupportCellMargin = 2e-14;  // of the body: round-off of the heights compared

// --- particles
constexpr double kUnitTurn = 1e-14;  // of a quaternion's squared length: within it the body is its own size

// --- certificate
constexpr double kLeastTolerance =
    10 * kRoundoff;  // of the larger radius: no bracket of the gap can be narrower. Two supports lack up to 2
                     // kSupportSlack each, the search over directions and bodies of revolution the rest
constexpr double kNoDirection =
    1e-10;  // a vector shorter than this, relative to the larger body, is mostly round-off

// --- joint Newton
constexpr double kSingular = 1e-13;  // 2 x 2 determinant over the sum of its products' sizes
constexpr double kStationary =
    1e-10;  // angle between the normals, and offset across them over the smaller radius
constexpr double kMateSizes = 16;      // a body's, up to which balls that touch a larger mate serve
constexpr double kUnequalSizes = 100;  // ratio of the bodies' from which the larger one's reach counts ...
constexpr double kTurnRate = 1e3;  // ... of how fast normals change: that of a rim of its radius over this
constexpr double kLargestStep = 0.35;  // of a patch's parameter range in one Newton step
constexpr double kNearer2 = 1e-3;  // squared offset across the normals over what it was: a step that leaves
                                   // more was none of Newton's, which squares it (next to poles)
constexpr double kNoTurn = kRoundoff * kRoundoff;  // rad^2: of a normal in a step
constexpr double kNormalTrust = 0.3;  // relative change of a tangent beyond which a step's normal is not used
constexpr double kBeyondPatch = 1e-6;  // in its parameters, that a step may lead
constexpr double kNearPole =
    1e-4;  // ratio of the tangents' lengths below which a plane's warm solve hands on
constexpr int kWarmIterations = 4;      // 1 or 2 are usual
constexpr int kFollowedIterations = 3;  // of pairs side by side; the ladder takes over
constexpr int kBridgeIterations = 6;    // over a dent; 2 or 3 are usual
constexpr int kPolishIterations = 12;   // from a cold start

// --- ellipsoids in closed form
constexpr int kEllipsoidSteps = 4;          // of Newton for a contact that goes on; 1 or 2 are usual ...
constexpr int kEllipsoidColdSteps = 60;     // ... and from a cold start, with halvings
constexpr double kEllipsoidTurn = 0.5;      // rad in one step
constexpr double kEllipsoidNear = 0.1;      // rad, of Newton: the next direction may be the answer
constexpr double kEllipsoidStalled = 1e-7;  // rad, of Newton: it is, or none is
constexpr double kEllipsoidError = 0.25;    // of the tolerance that the bodies may be off ellipsoids, at most

// --- local model
constexpr double kLargestTurn = 0.5;       // rad; the chord that stands for the turn is then shorter by ...
constexpr double kTurnOverChord = 1.033;   // ... no more than this, cubed
constexpr double kRemainderSafety = 1.05;  // on the third-order remainder: that, and round-off
constexpr double kRemainderShare = 0.1;    // of the bound on the maps' remainder that normals err by: rates
                                           // are the largest of a patch, doubled, and no turn meets them all
constexpr double kForceDepth = 1e-3;       // of the smaller radius: overlaps are right to the tolerance times
                                           // themselves, or times this if they are shallower
constexpr double kLocalDrift = 20;         // of the tolerance that the contact points may be off

// --- cylinders (angles of directions square to the axis)
constexpr int kModelTurns = 3;           // of Newton over a local model: 1 or 2 are usual
constexpr int kDistanceIterations = 5;   // of Newton for the distance from the axis; the next way takes over
constexpr int kRingSupports = 6;         // of Newton over supports
constexpr double kModelAngle = 1e-13;    // of that over a model: found
constexpr double kRingAngle = 1e-10;     // of the others: the evaluated point is the answer
constexpr double kRingSupport = 1e-10;   // what a support may lack
constexpr double kSmallDent = 0.01;      // of the tolerance: what dents may take from one
constexpr double kSameMaximum = 1e-9;    // maxima of the reach this near are one
constexpr double kCoarsestRing = 0.79;   // between directions where maxima are looked for first ...
constexpr double kRingLadder = 2.5;      // ... or factor between those about a known one ...
constexpr double kNearKnown = 0.5;       // ... up to here
constexpr double kFinestRing = 2e-3;     // maxima closer than this, or ...
constexpr double kNearestOnWall = 0.02;  // ... than this on the wall, of the radii, are found as one
constexpr double kNarrowArc = 0.1;       // arcs up to this wide may be proven to have one maximum
constexpr double kLooseArc = 0.01;    // ... and those where the reach is little below the radius are halved
constexpr double kSurveyRoom = 4e-3;  // that a body may move from where the circle was surveyed ...
constexpr double kOpenSurveyRoom = 3e-4;  // ... or where its contacts are not proven alone
constexpr double kRingNormals = 0.011;  // between normals looked up: half of it and kSurveyRoom are less than
                                        // kNormalMargin

// --- polytope method
constexpr int kHullVertices = 1152;     // support pairs a fallback may spend; 20 to 80 are usual
constexpr int kHullFaces = 4608;        // twice the vertices, and room for those being replaced
constexpr int kHullAttempts = 6;        // from other directions, when round-off stalled the hull
constexpr double kHullTurn = 0.2;       // between them
constexpr double kCoreShare = 0.5;      // of the smaller of the bodies' least curvature radii taken off, the
                                        // other wholly: more would leave two spheres no volume
constexpr double kCoreError = 0.1;      // of the tolerance, that sphero-polyhedra may be off by
constexpr double kFlatStart = 1e-3;     // volume of a first tetrahedron over its longest edge cubed, at least
constexpr double kNeedleStart = 1e-7;   // ... and of needles, where looking for better ones did not help ...
constexpr int kNeedleRound = 2;         // ... so often
constexpr int kFlatRounds = 4;          // of looking for a better one
constexpr double kLeastHeight = 0.02;   // of the tolerance: a point less high above a face is not added
constexpr double kHullSlope = 1e-7;     // rad: points of the polytope's hull are this near to their supports'
constexpr double kSupportShare = 0.01;  // of the tolerance that a support may lack
constexpr int kMostMinima = 8;          // of p(d) that are gone straight to and surrounded
constexpr double kPolishAbove = 0.1;  // of the least overlap seen: one more than that above it is no minimum
constexpr double kSurroundAbove = 1e-3;  // the same for surrounding it
constexpr double kSameMinimum = 0.98;    // cosine above which two are one
constexpr int kMostBalances = 40;
constexpr double kPolishGain = 1e-3;    // of the tolerance, below which a minimum has been reached
constexpr double kLongestPolish = 0.3;  // rad in one step
constexpr int kBalanceSteps = 4;        // of Newton along a crease of p(d)
constexpr double kHeldSlope = 1e-9;     // of d . x across a patch's edge: steeper, the edge holds the support
constexpr double kHeldSpeed = 1e-6;     // of a parameter, over the bounding radius; slower, at a pole
constexpr double kRingShare = 1.6;  // of w / depth between the rings of directions about a deep minimum ...
constexpr double kLeastRing = 2, kMostRing = 16;  // ... with these limits
constexpr double kLeastSpread = 1e-3;             // of the depth: the least w worth rings
constexpr double kWidestRing = 0.7;               // rad, along the direction of larger w ...
constexpr double kWidestTilted = 1.2;             // ... and in any
constexpr double kSliver = 1e-13;  // triangles of the hull lower than this, relative to the larger body, have
                                   // no normal of their own
constexpr double kJoggle = 1e-11;  // the second hull's vertices move by this, relative to the larger body
constexpr double kJoggleWaves = 37;  // of it across a body, rad
constexpr double kTie = 1e-14;       // squared distances this close, relatively, are equal
constexpr double kFarAway = 1e300;   // larger than any length

// --- direction search (cold start)
constexpr int kScanCells = 4;       // per cube edge: 96 directions, 0.4 rad apart
constexpr int kScanMoves = 6;       // of the compass search per stride
constexpr double kDistinct = 0.75;  // cosine above which two guesses are in one basin
constexpr int kColdGuesses = 4;     // local minima tried when the overlap is deep

}  // namespace nurbs
