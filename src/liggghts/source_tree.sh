#!/bin/sh
# Puts the NURBS styles into a LIGGGHTS source tree, or takes them out again.
#   source_tree.sh install   LIGGGHTS_SRC BUILD ARCH    links the style sources and sets PKG_INC, PKG_LIB
#   source_tree.sh uninstall LIGGGHTS_SRC
# The host's make finds styles by the macros in their headers, so register.cpp, main.cpp and styles.h stay behind. The
# core goes in as one static library; the host is compiled for the same ARCH, because Eigen's alignment depends on it.
set -eu

action=$1
host=$2
here=$(cd "$(dirname "$0")" && pwd)
begin="# nurbs: begin (make -f Makefile.package uninstall removes this)"
end="# nurbs: end"

if [ ! -f "$host/atom_vec_sphere.cpp" ]; then
  echo "ERROR: LIGGGHTS_SRC=$host is not the src directory of LIGGGHTS" >&2
  exit 1
fi

remove() {
  for file in "$host"/*.h "$host"/*.cpp; do
    case $(readlink "$file" || true) in
      "$here"/*) rm "$file" ;;
    esac
  done
  if [ -f "$host/Makefile.package" ]; then
    sed -i "/^# nurbs: begin/,/^# nurbs: end/d" "$host/Makefile.package"
  fi
}

add() {
  build=$1
  arch=$2
  [ -e "$host/Makefile.package" ] || cp "$host/Makefile.package.empty" "$host/Makefile.package"
  for file in "$here"/*.h "$here"/*.cpp; do
    case $(basename "$file") in
      register.cpp | main.cpp | styles.h) ;;
      *) ln -s "$file" "$host/" ;;
    esac
  done
  {
    echo "$begin"
    echo "PKG_INC += -std=c++17 -march=$arch -DOMPI_SKIP_MPICXX -I$(dirname "$here") -I$(cd "$host" && pwd) -isystem /usr/include/eigen3"
    echo "PKG_LIB += $build/libnurbs.a"
    echo "$end"
  } >>"$host/Makefile.package"
}

remove
if [ "$action" = install ]; then
  add "$3" "$4"
  echo "NURBS styles linked into $host. Build there, for example: make -C $host auto"
else
  echo "NURBS styles removed from $host."
fi
