// The host's contact models of this kind: its own generated list, which is not packaged.
#include "surface_model_default.h"
