#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Builds the tests of memory and threads and the examples of the library under a sanitizer and runs them:
#   bash tests/sanitize.sh asan|tsan [JOBS]
# Outside CI: most of an hour on two cores. Ends with a line a program, and with status 1 where one failed or reported.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
preset=${1:?asan or tsan} jobs=${2:-2}
build=build/$preset
tests=(remesh_test remesh_curved_test remesh_curved_prediction_test remesh_curved_run_test remesh_curved_contact_test candidates_test curved_host_test change_log_test reuse_test newton_parts_test remesh_3d_test remesh_decision_test remesh_allocation_test prospect_test history_transfer_test simulation_test host_test embed_test mesh_change_test bad_input_test hdf5_test task_factor_test adaptive_time_test error_estimator_test cavity_test friction_pairs_test volume_patches_test axisymmetry_test polyfem_keys_test tie_test periodic_tie_test fluid_test averaged_contact_test friction_directions_test rigid_test overlap_test viscous_test eigenstrain_test shapes_property_test support_test)
examples=(own_time_loop own_energy_term own_material own_solver contact_only transfer two_threads coupling)
# HDF5 asks for as much memory as a damaged file says, and gets over not having it.
export OMP_NUM_THREADS=1 ASAN_OPTIONS="allocator_may_return_null=1 suppressions=$PWD/tests/asan.supp" LSAN_OPTIONS="suppressions=$PWD/tests/lsan.supp print_suppressions=0" TSAN_OPTIONS="suppressions=$PWD/tests/tsan.supp history_size=4" UBSAN_OPTIONS=print_stacktrace=1
case $preset in asan) sanitizer=address,undefined ;; tsan) sanitizer=thread ;; *) echo "asan or tsan, not $preset" >&2; exit 2 ;; esac

cmake --preset "$preset" && cmake --build --preset "$preset" --target "${tests[@]}" fuzz_readers -- -j "$jobs" || exit 1

mkdir -p "$build/examples"
flags=(-O1 -fno-omit-frame-pointer -fsanitize=$sanitizer -march=x86-64-v3 -DEIGEN_MAX_ALIGN_BYTES=32 -Iinclude -isystem /usr/include/eigen3)
libraries=("$build/lib/libitr.a" -ltbb -lfmt -lhdf5_serial -lgmp -lmpfr -lz -ldl -lpthread -lm)
for name in "${examples[@]}"; do
  "${CXX:-c++}" -std=c++20 "${flags[@]}" "examples/api/$name.cpp" "${libraries[@]}" -o "$build/examples/$name" || exit 1
done
"${CC:-cc}" "${flags[@]}" -c examples/api/bounce.c -o "$build/examples/bounce.o" &&
  "${CXX:-c++}" -fsanitize=$sanitizer "$build/examples/bounce.o" "${libraries[@]}" -o "$build/examples/bounce" || exit 1

failed=0
run() {  # NAME COMMAND...
  local log=$build/$1.log
  timeout 1800 "${@:2}" >"$log" 2>&1
  local status=$? reports
  reports=$(grep -cE 'WARNING: ThreadSanitizer|ERROR: AddressSanitizer|ERROR: LeakSanitizer|runtime error:' "$log")
  echo "$1: exit status $status, $reports reports"
  [ "$status" = 0 ] && [ "$reports" = 0 ] || failed=1
}
for name in "${tests[@]}"; do run "$name" "$build/tests/$name"; done
[ "$preset" = tsan ] || run fuzz_readers "$build/tests/fuzz_readers" 10000
for name in "${examples[@]}" bounce; do
  if [ "$name" = own_solver ]; then run "$name" "$build/examples/$name" examples/masticator.json 10; else run "$name" "$build/examples/$name"; fi
done
exit $failed
