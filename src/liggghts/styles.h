// The list of NURBS styles: one header per style, each with the host's XxxStyle(name, class) macro.
// register.cpp reads this list once per kind of style, so it has no include guard, as the host's own
// style_*.h. Add a style by adding its header here.
#include "liggghts/atom_vec_nurbs.h"
#include "liggghts/compute_contact_atom_nurbs.h"
#include "liggghts/compute_erotate_nurbs.h"
#include "liggghts/compute_nurbs_atom.h"
#include "liggghts/compute_nurbs_energy.h"
#include "liggghts/compute_nurbs_local.h"
#include "liggghts/compute_nurbs_stats.h"
#include "liggghts/dump_nurbs_vtk.h"
#include "liggghts/fix_check_timestep_gran_nurbs.h"
#include "liggghts/fix_contact_history_nurbs.h"
#include "liggghts/fix_insert_pack_nurbs.h"
#include "liggghts/fix_nve_nurbs.h"
#include "liggghts/fix_template_nurbs.h"
#include "liggghts/fix_wall_nurbs.h"
#include "liggghts/pair_gran_nurbs.h"
