// SPDX-License-Identifier: MIT
#include "hdf5.hpp"

#include <algorithm>
#include <array>

#include "itr/core/error.hpp"

namespace itr::hdf5 {

namespace {

std::mutex& library_mutex() {
  static std::mutex mutex;
  return mutex;
}

InputError unusable(const std::filesystem::path& path, const std::string& place, const std::string& expected) {
  return InputError({path.string(), place, "HDF5 could not do it", expected});
}

/// Of variable length: what readers such as h5py give out as text and not as bytes.
Handle text_type() {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.id(), H5T_VARIABLE);
  H5Tset_cset(type.id(), H5T_CSET_UTF8);
  return type;
}

}  // namespace

Session::Session() : lock_(library_mutex()) {
  H5Eget_auto2(H5E_DEFAULT, &print_, &print_data_);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

Session::~Session() { H5Eset_auto2(H5E_DEFAULT, print_, print_data_); }

File File::create(const std::filesystem::path& path) {
  constexpr std::size_t kIncrement = 1 << 16;
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_fapl_core(access.id(), kIncrement, false);
  Handle file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.id()), H5Fclose);
  if (!file.is_valid()) throw unusable(path, "file", "memory for it");
  return File(path, std::move(file));
}

File File::open(const std::filesystem::path& path) {
  Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!file.is_valid()) throw unusable(path, "file", "a readable, complete HDF5 file");
  return File(path, std::move(file));
}

void File::require(bool ok, const std::string& what) const {
  if (!ok) throw unusable(path_, what, "to be written or read");
}

void File::write_raw(const std::string& name, hid_t type, const void* values, std::size_t size, int columns) {
  if (const auto it = written_.find(name); it != written_.end()) {
    const Written& before = it->second;
    require(before.size == size && before.columns == columns, name);
    if (size > 0) require(H5Dwrite(before.set.id(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0, name);
    return;
  }
  const std::array<hsize_t, 2> shape = {columns ? size / columns : size, static_cast<hsize_t>(columns)};
  const Handle space(H5Screate_simple(columns ? 2 : 1, shape.data(), nullptr), H5Sclose);
  const Handle links(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
  H5Pset_create_intermediate_group(links.id(), 1);
  Handle set(H5Dcreate2(file_.id(), name.c_str(), type, space.id(), links.id(), H5P_DEFAULT, H5P_DEFAULT), H5Dclose);
  require(set.is_valid(), name);
  if (size > 0) require(H5Dwrite(set.id(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0, name);
  written_.emplace(name, Written{std::move(set), size, columns});
}

void File::write(const std::string& name, std::span<const double> values, int columns) {
  write_raw(name, H5T_NATIVE_DOUBLE, values.data(), values.size(), columns);
}

void File::write(const std::string& name, std::span<const std::int64_t> values, int columns) {
  write_raw(name, H5T_NATIVE_INT64, values.data(), values.size(), columns);
}

void File::write_attribute_raw(const char* name, hid_t type, const void* value) {
  auto it = attributes_.find(name);
  if (it == attributes_.end()) {
    const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
    Handle attribute(H5Acreate2(file_.id(), name, type, space.id(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    require(attribute.is_valid(), name);
    it = attributes_.emplace(name, std::move(attribute)).first;
  }
  require(H5Awrite(it->second.id(), type, value) >= 0, name);
}

void File::write_attribute(const char* name, double value) { write_attribute_raw(name, H5T_NATIVE_DOUBLE, &value); }

void File::write_attribute(const char* name, std::int64_t value) { write_attribute_raw(name, H5T_NATIVE_INT64, &value); }

void File::write_attribute(const std::string& object, const char* name, std::span<const std::int64_t> values) {
  const hsize_t size = values.size();
  const Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose);
  const Handle attribute(H5Acreate_by_name(file_.id(), object.c_str(), name, H5T_NATIVE_INT64, space.id(), H5P_DEFAULT,
                                           H5P_DEFAULT, H5P_DEFAULT),
                         H5Aclose);
  require(attribute.is_valid() && H5Awrite(attribute.id(), H5T_NATIVE_INT64, values.data()) >= 0, object + ", " + name);
}

void File::write_attribute(const std::string& object, const char* name, const std::string& text) {
  const Handle type = text_type(), space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle attribute(
      H5Acreate_by_name(file_.id(), object.c_str(), name, type.id(), space.id(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
      H5Aclose);
  const char* start = text.c_str();
  require(attribute.is_valid() && H5Awrite(attribute.id(), type.id(), &start) >= 0, object + ", " + name);
}

void File::link_file(const std::string& name, const std::string& relative_path) {
  const Handle links(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
  H5Pset_create_intermediate_group(links.id(), 1);
  require(H5Lcreate_external(relative_path.c_str(), "/", file_.id(), name.c_str(), links.id(), H5P_DEFAULT) >= 0, name);
}

void File::unlink(const std::string& name) {
  written_.erase(name);
  require(H5Ldelete(file_.id(), name.c_str(), H5P_DEFAULT) >= 0, name);
}

void File::write_text(const std::string& name, const std::string& text) {
  write_raw(name, H5T_NATIVE_CHAR, text.data(), text.size(), 0);
}

std::string File::image() const {
  require(H5Fflush(file_.id(), H5F_SCOPE_LOCAL) >= 0, "file");
  const ssize_t size = H5Fget_file_image(file_.id(), nullptr, 0);
  require(size > 0, "file");
  std::string bytes(static_cast<std::size_t>(size), '\0');
  require(H5Fget_file_image(file_.id(), bytes.data(), bytes.size()) == size, "file");
  return bytes;
}

bool File::contains(const std::string& name) const { return H5Lexists(file_.id(), name.c_str(), H5P_DEFAULT) > 0; }

void File::read_attribute_raw(const char* name, hid_t type, void* value) const {
  const Handle attribute(H5Aopen(file_.id(), name, H5P_DEFAULT), H5Aclose);
  require(attribute.is_valid() && H5Aread(attribute.id(), type, value) >= 0, name);
}

std::string File::read_text_attribute(const std::string& object, const char* name) const {
  const Handle attribute(H5Aopen_by_name(file_.id(), object.c_str(), name, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  char* start = nullptr;
  require(attribute.is_valid() && H5Aread(attribute.id(), text_type().id(), &start) >= 0, object + ", " + name);
  std::string text(start);
  H5free_memory(start);
  return text;
}

std::int64_t File::read_integer_attribute(const char* name) const {
  std::int64_t value = 0;
  read_attribute_raw(name, H5T_NATIVE_INT64, &value);
  return value;
}

double File::read_double_attribute(const char* name) const {
  double value = 0;
  read_attribute_raw(name, H5T_NATIVE_DOUBLE, &value);
  return value;
}

std::vector<std::int64_t> File::read_integers_attribute(const std::string& object, const char* name) const {
  const std::string what = object + ", attribute " + name;
  const Handle attribute(H5Aopen_by_name(file_.id(), object.c_str(), name, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  require(attribute.is_valid(), what);
  const Handle space(H5Aget_space(attribute.id()), H5Sclose);
  const hssize_t size = H5Sget_simple_extent_npoints(space.id());
  require(size >= 0, what);
  std::vector<std::int64_t> values(static_cast<std::size_t>(size));
  require(H5Aread(attribute.id(), H5T_NATIVE_INT64, values.data()) >= 0, what);
  return values;
}

std::string File::read_text(const std::string& name) const {
  const Table<char> table = read_raw<char>(name, H5T_NATIVE_CHAR);
  return {table.values.begin(), table.values.end()};
}

Handle File::open_dataset(const std::string& name) const {
  Handle dataset(H5Dopen2(file_.id(), name.c_str(), H5P_DEFAULT), H5Dclose);
  require(dataset.is_valid(), name);
  return dataset;
}

Shape File::shape_of(const Handle& dataset, const std::string& name) const {
  const Handle space(H5Dget_space(dataset.id()), H5Sclose);
  const int rank = H5Sget_simple_extent_ndims(space.id());
  require(rank == 1 || rank == 2, name);
  std::array<hsize_t, 2> extent = {0, 0};
  H5Sget_simple_extent_dims(space.id(), extent.data(), nullptr);
  require(rank == 1 || extent[1] > 0, name);
  return {extent[0], static_cast<int>(extent[1])};
}

Shape File::shape(const std::string& name) const { return shape_of(open_dataset(name), name); }

template <typename T>
Table<T> File::read_raw(const std::string& name, hid_t type) const {
  const Handle dataset = open_dataset(name);
  const Shape shape = shape_of(dataset, name);
  Table<T> table;
  table.columns = shape.columns;
  table.values.resize(shape.rows * std::max(shape.columns, 1));
  if (!table.values.empty()) {
    require(H5Dread(dataset.id(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, table.values.data()) >= 0, name);
  }
  return table;
}

Table<double> File::read_doubles(const std::string& name) const { return read_raw<double>(name, H5T_NATIVE_DOUBLE); }

Table<std::int64_t> File::read_integers(const std::string& name) const {
  return read_raw<std::int64_t>(name, H5T_NATIVE_INT64);
}

}  // namespace itr::hdf5
