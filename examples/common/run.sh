# Sourced by an example's `run`, which sets `name`: makes the programs if they are missing, clears BUILD/$name, goes there,
# and offers the steps that examples share. RANKS=n: on n ranks.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
build=${BUILD:-build}
case $build in /*) ;; *) build=$root/$build ;; esac
# mpirun as root and with fewer cores than ranks; waiting ranks let others run.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1
export OMPI_MCA_hwloc_base_binding_policy=none OMPI_MCA_mpi_yield_when_idle=1 OMP_NUM_THREADS=1
[ -x "$build/liggghts-nurbs" ] || make -s -f "$root/Makefile.package" -C "$root" BUILD="$build" build
rm -rf "${build:?}/$name"
mkdir -p "$build/$name"
cd "$build/$name"
began=$(date +%s)

# shape NAME KIND ..: NAME.json by nurbs-shape make.
shape() {
  file=$1.json
  shift
  "$build/nurbs-shape" make "$@" -o "$file" >/dev/null
}

# spheroid sphere|flat|long: a spheroid of a unit ball's volume, of aspect ratio 1, 0.6, 1.5.
spheroid() {
  case $1 in
    sphere) shape sphere ellipsoid --axes 1,1,1 ;;
    flat) shape flat ellipsoid --axes 1.1856,1.1856,0.7114 ;;
    long) shape long ellipsoid --axes 0.8736,0.8736,1.3104 ;;
  esac
}

# simulate FOLDER [-var ..]: the deck in.$name, in a folder that has what it reads.
simulate() (
  cd "$1"
  echo "$1"
  shift
  mpirun -np "${RANKS:-2}" "$build/liggghts-nurbs" -in "$here/in.$name" -log "log.$name" "$@" >screen.txt ||
    { tail -n 5 screen.txt; exit 1; }
)

# finish FILE ..: draws, and says what came out.
finish() {
  echo "simulations: $(($(date +%s) - began)) s on ${RANKS:-2} ranks"
  /usr/bin/python3 "$here/plot.py" .
  echo "results in $(pwd): $*"
}
