// The host's contact models of this kind: its own generated list, which is not packaged.
#include "rolling_model_cdt.h"
#include "rolling_model_epsd.h"
#include "rolling_model_epsd2.h"
#include "rolling_model_epsd3.h"
#include "rolling_model_luding.h"
