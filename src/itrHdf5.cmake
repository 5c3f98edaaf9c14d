# SPDX-License-Identifier: MIT
# Target itr::hdf5: the *serial* HDF5 C library. FindHDF5 takes the MPI one where both are installed and the alternatives
# point there; Debian keeps the serial one apart under its own names.
if(NOT TARGET itr::hdf5)
  find_path(ITR_HDF5_INCLUDE_DIR hdf5.h PATH_SUFFIXES hdf5/serial REQUIRED)
  find_library(ITR_HDF5_LIBRARY NAMES hdf5_serial hdf5 PATH_SUFFIXES hdf5/serial REQUIRED)
  mark_as_advanced(ITR_HDF5_INCLUDE_DIR ITR_HDF5_LIBRARY)
  add_library(itr::hdf5 UNKNOWN IMPORTED)
  set_target_properties(itr::hdf5 PROPERTIES IMPORTED_LOCATION "${ITR_HDF5_LIBRARY}"
    INTERFACE_INCLUDE_DIRECTORIES "${ITR_HDF5_INCLUDE_DIR}")
endif()
