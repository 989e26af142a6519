// The host's contact models of this kind: its own generated list, which is not packaged.
#include "tangential_model_history.h"
#include "tangential_model_luding_tn.h"
#include "tangential_model_no_history.h"
