// The host's contact models of this kind: its own generated list, which is not packaged.
#include "cohesion_model_sjkr.h"
#include "cohesion_model_sjkr2.h"
