# shellcheck shell=bash
# Source this (". launch/env.sh") before mpirun: what Open MPI wants where ranks run as root, outnumber the
# cores, or use threads. Each setting may be overridden by setting it first. Other MPIs ignore all of them.

# As root, for example in a container, Open MPI refuses to start without these two.
export OMPI_ALLOW_RUN_AS_ROOT="${OMPI_ALLOW_RUN_AS_ROOT:-1}"
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="${OMPI_ALLOW_RUN_AS_ROOT_CONFIRM:-1}"
# More ranks than cores are allowed: slower, but the same answer.
export OMPI_MCA_rmaps_base_oversubscribe="${OMPI_MCA_rmaps_base_oversubscribe:-1}"
# By default Open MPI binds every rank to one core, which would leave the threads of a rank to share it.
export OMPI_MCA_hwloc_base_binding_policy="${OMPI_MCA_hwloc_base_binding_policy:-none}"
# Ranks that wait let others run. Spinning is a little faster on cores of one's own, and several times slower
# on shared ones, or where threads of the ranks want them.
export OMPI_MCA_mpi_yield_when_idle="${OMPI_MCA_mpi_yield_when_idle:-1}"

# Where cargo installs programs.
demhybrid_bin="${CARGO_INSTALL_ROOT:-${CARGO_HOME:-$HOME/.cargo}}/bin"
case ":$PATH:" in
*":$demhybrid_bin:"*) ;;
*) export PATH="$demhybrid_bin:$PATH" ;;
esac
unset demhybrid_bin
