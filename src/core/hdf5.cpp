// SPDX-License-Identifier: MIT
#include "hdf5.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <limits>

#include "itr/core.hpp"

namespace itr::hdf5 {

namespace {

std::mutex& library_mutex() {
  static std::mutex mutex;
  return mutex;
}

InputError unusable(const std::filesystem::path& path, const std::string& place, const std::string& expected) {
  return InputError({path.string(), place, "HDF5 could not do it", expected});
}

/// Makes the type of texts of variable length, which readers such as h5py give out as text and not as bytes.
Handle text_type() {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.id(), H5T_VARIABLE);
  H5Tset_cset(type.id(), H5T_CSET_UTF8);
  return type;
}

constexpr const char* kDigests = "/digests";

/// Another one whenever one of its words of eight bytes is another: each round is one to one.
std::uint64_t digest(const void* values, std::size_t bytes) {
  constexpr std::uint64_t kOdd = 0x9e3779b97f4a7c15;
  std::uint64_t result = bytes;
  const auto mix = [&](std::uint64_t word) {
    result = (result ^ word) * kOdd;
    result ^= result >> 32;
  };
  const auto* at = static_cast<const char*>(values);
  std::uint64_t word = 0;
  for (; bytes >= sizeof(word); bytes -= sizeof(word), at += sizeof(word)) {
    std::memcpy(&word, at, sizeof(word));
    mix(word);
  }
  word = 0;
  if (bytes > 0) std::memcpy(&word, at, bytes);
  mix(word);
  return result;
}

/// Called where a link leads to another file: negative ends the search.
herr_t refuse_link(const char*, const char*, const char*, const char*, unsigned*, hid_t, void* left_file) {
  *static_cast<bool*>(left_file) = true;
  return -1;
}

/// Whether values of a type are numbers that we store, or something that HDF5 can only make numbers of.
bool is_number(hid_t type) {
  constexpr std::size_t kLargest = 16;
  const H5T_class_t kind = H5Tget_class(type);
  return (kind == H5T_INTEGER || kind == H5T_FLOAT) && H5Tget_size(type) > 0 && H5Tget_size(type) <= kLargest;
}

/// a * b, or the largest number where that is beyond it.
std::uint64_t saturated_product(std::uint64_t a, std::uint64_t b) {
  constexpr auto kMost = std::numeric_limits<std::uint64_t>::max();
  return b != 0 && a > kMost / b ? kMost : a * b;
}

}  // namespace

Session::Session() : lock_(library_mutex()) {
  H5Eget_auto2(H5E_DEFAULT, &print_, &print_data_);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

Session::~Session() { H5Eset_auto2(H5E_DEFAULT, print_, print_data_); }

File::File(std::filesystem::path path, Handle file)
    : path_(std::move(path)),
      left_file_(std::make_unique<bool>(false)),
      file_(std::move(file)),
      access_(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose) {}

File File::create(const std::filesystem::path& path) {
  constexpr std::size_t kIncrement = 1 << 16;
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_fapl_core(access.id(), kIncrement, false);
  // HDF5 takes files in memory of one name for one file, which may be open: frames of a run, say.
  auto key = std::make_unique<bool>(false);
  const std::string name = fmt::format("{} {}", path.string(), static_cast<const void*>(key.get()));
  Handle handle(H5Fcreate(name.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.id()), H5Fclose);
  if (!handle.is_valid()) throw unusable(path, "file", "memory for it");
  File file(path, std::move(handle));
  file.left_file_ = std::move(key);
  return file;
}

File File::open(const std::filesystem::path& path, OtherFiles others) {
  Handle handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!handle.is_valid()) throw unusable(path, "file", "a readable, complete HDF5 file");
  File file(path, std::move(handle));
  if (others == OtherFiles::refused) H5Pset_elink_cb(file.access_.id(), refuse_link, file.left_file_.get());
  file.read_digests();
  return file;
}

void File::refuse(const std::string& what, const std::string& found, const std::string& expected) const {
  throw InputError({path_.string(), what, found, expected});
}

void File::require(bool ok, const std::string& what) const {
  if (!ok && std::exchange(*left_file_, false)) refuse(what, "a link to another file", "data of this file");
  if (!ok) throw unusable(path_, what, "to be written or read");
}

void File::read_digests() {
  if (!contains(kDigests)) return;
  const std::string text = read_text(kDigests);
  for (std::size_t line = 0; line < text.size();) {
    const std::size_t end = std::min(text.find('\n', line), text.size()), space = text.rfind(' ', end);
    if (space == text.npos || space < line)
      refuse(kDigests, "a line without a digest", "those that were written: the file is damaged");
    const char* const last = text.data() + end;
    std::uint64_t value = 0;
    if (const auto [stop, error] = std::from_chars(text.data() + space + 1, last, value, 16);
        error != std::errc() || stop != last)
      refuse(kDigests, "a digest that is no number", "those that were written: the file is damaged");
    digests_[text.substr(line, space - line)] = value;
    line = end + 1;
  }
}

void File::compare_digest(const std::string& name, const void* values, std::size_t bytes) const {
  const auto written = digests_.find(name);
  if (written == digests_.end() || written->second == digest(values, bytes)) return;
  refuse(name[0] == '@' ? "attribute " + name.substr(1) : name, "values of another digest",
         "those that were written: the file is damaged");
}

std::vector<std::string> File::digest_names() const {
  std::vector<std::string> names;
  for (const auto& [name, ignored] : digests_) names.push_back(name);
  return names;
}

bool File::holds_text(const std::string& name) const {
  const Handle dataset = open_dataset(name), type(H5Dget_type(dataset.id()), H5Tclose);
  return H5Tget_class(type.id()) == H5T_INTEGER && H5Tget_size(type.id()) == 1;
}

bool File::holds_integers(const std::string& name) const {
  const Handle dataset = open_dataset(name), type(H5Dget_type(dataset.id()), H5Tclose);
  return H5Tget_class(type.id()) == H5T_INTEGER && H5Tget_size(type.id()) > 1;
}

std::vector<std::string> File::find_damage() const {
  std::vector<std::string> damaged;
  for (const auto& [name, ignored] : digests_) {
    try {
      if (name[0] == '@')
        compare_attribute(name.c_str() + 1);
      else if (holds_text(name))
        read_text(name);
      else if (holds_integers(name))
        read_integers(name);
      else
        read_doubles(name);
    } catch (const InputError&) {
      damaged.push_back(name[0] == '@' ? "attribute " + name.substr(1) : name);
    }
  }
  return damaged;
}

void File::compare_attribute(const char* name) const {
  const Handle attribute = open_attribute("/", name), type(H5Aget_type(attribute.id()), H5Tclose);
  if (H5Tget_class(type.id()) == H5T_FLOAT)
    read_double_attribute(name);
  else
    read_integer_attribute(name);
}

void File::write_raw(const std::string& name, hid_t type, const void* values, std::size_t size, int columns) {
  if (const auto it = written_.find(name); it != written_.end()) {
    Written& before = it->second;
    require(before.size == size && before.columns == columns, name);
    before.digest = digest(values, size * H5Tget_size(type));
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
  written_.emplace(name, Written{std::move(set), size, columns, digest(values, size * H5Tget_size(type))});
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
    it = attributes_.emplace(name, WrittenAttribute{std::move(attribute), 0}).first;
  }
  it->second.digest = digest(value, H5Tget_size(type));
  require(H5Awrite(it->second.attribute.id(), type, value) >= 0, name);
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

void File::unlink(const std::string& name) {
  std::erase_if(written_, [&](const auto& entry) { return entry.first == name || entry.first.starts_with(name + "/"); });
  require(H5Ldelete(file_.id(), name.c_str(), H5P_DEFAULT) >= 0, name);
}

void File::write_text(const std::string& name, const std::string& text) {
  write_raw(name, H5T_NATIVE_CHAR, text.data(), text.size(), 0);
}

std::string File::image() {
  std::string digests;
  for (const auto& [name, set] : written_)
    if (name != kDigests) digests += fmt::format("{} {:016x}\n", name, set.digest);
  for (const auto& [name, attribute] : attributes_) digests += fmt::format("@{} {:016x}\n", name, attribute.digest);
  if (!digests.empty()) write_text(kDigests, digests);
  require(H5Fflush(file_.id(), H5F_SCOPE_LOCAL) >= 0, "file");
  const ssize_t size = H5Fget_file_image(file_.id(), nullptr, 0);
  require(size > 0, "file");
  std::string bytes(static_cast<std::size_t>(size), '\0');
  require(H5Fget_file_image(file_.id(), bytes.data(), bytes.size()) == size, "file");
  return bytes;
}

bool File::contains(const std::string& name) const {
  const htri_t exists = H5Lexists(file_.id(), name.c_str(), access_.id());
  if (exists < 0 && *left_file_) require(false, name);
  if (exists <= 0 && digests_.contains(name)) refuse(name, "nothing", "what was written: the file is damaged");
  return exists > 0;
}

Handle File::open_attribute(const std::string& object, const char* name) const {
  Handle attribute(H5Aopen_by_name(file_.id(), object.c_str(), name, H5P_DEFAULT, access_.id()), H5Aclose);
  require(attribute.is_valid(), object + ", attribute " + name);
  return attribute;
}

void File::read_attribute_raw(const char* name, hid_t type, void* value) const {
  const Handle attribute = open_attribute("/", name);
  const Handle space(H5Aget_space(attribute.id()), H5Sclose), stored(H5Aget_type(attribute.id()), H5Tclose);
  require(H5Sget_simple_extent_npoints(space.id()) == 1 && is_number(stored.id()), std::string("attribute ") + name);
  require(H5Aread(attribute.id(), type, value) >= 0, std::string("attribute ") + name);
  compare_digest(std::string("@") + name, value, H5Tget_size(type));
}

std::string File::read_text_attribute(const std::string& object, const char* name) const {
  const std::string what = object + ", attribute " + name;
  const Handle attribute = open_attribute(object, name);
  const Handle space(H5Aget_space(attribute.id()), H5Sclose), stored(H5Aget_type(attribute.id()), H5Tclose);
  require(H5Sget_simple_extent_npoints(space.id()) == 1 && H5Tis_variable_str(stored.id()) > 0, what);
  char* start = nullptr;
  require(H5Aread(attribute.id(), text_type().id(), &start) >= 0 && start, what);
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
  constexpr hssize_t kMost = 1 << 16;  // what the header of an object can hold
  const std::string what = object + ", attribute " + name;
  const Handle attribute = open_attribute(object, name);
  const Handle space(H5Aget_space(attribute.id()), H5Sclose), stored(H5Aget_type(attribute.id()), H5Tclose);
  const hssize_t size = H5Sget_simple_extent_npoints(space.id());
  require(size >= 0 && size <= kMost && is_number(stored.id()), what);
  std::vector<std::int64_t> values(static_cast<std::size_t>(size));
  require(H5Aread(attribute.id(), H5T_NATIVE_INT64, values.data()) >= 0, what);
  return values;
}

std::string File::read_text(const std::string& name) const {
  const Table<char> table = read_raw<char>(name, H5T_NATIVE_CHAR);
  return {table.values.begin(), table.values.end()};
}

Handle File::open_dataset(const std::string& name) const {
  Handle dataset(H5Dopen2(file_.id(), name.c_str(), access_.id()), H5Dclose);
  require(dataset.is_valid(), name);
  const Handle properties(H5Dget_create_plist(dataset.id()), H5Pclose);
  require(properties.is_valid(), name);
  if (H5Pget_external_count(properties.id()) != 0 || H5Pget_layout(properties.id()) == H5D_VIRTUAL)
    refuse(name, "values that are stored in another file", "values in this one");
  return dataset;
}

Shape File::shape_of(const Handle& dataset, const std::string& name) const {
  constexpr hsize_t kMost = std::numeric_limits<int>::max();
  const Handle space(H5Dget_space(dataset.id()), H5Sclose);
  const int rank = H5Sget_simple_extent_ndims(space.id());
  require(rank == 1 || rank == 2, name);
  std::array<hsize_t, 2> extent = {0, 0};
  require(H5Sget_simple_extent_dims(space.id(), extent.data(), nullptr) == rank, name);
  if (extent[0] > kMost || extent[1] > kMost || (rank == 2 && extent[1] == 0))
    refuse(name, fmt::format("{} rows, {} columns", extent[0], extent[1]), fmt::format("1 to {}", kMost));
  return {extent[0], static_cast<int>(extent[1])};
}

void File::check_room(const Handle& dataset, const Shape& shape, const std::string& name) const {
  constexpr std::uint64_t kMostPacked = 1032;  // times, by deflate
  const Handle type(H5Dget_type(dataset.id()), H5Tclose), properties(H5Dget_create_plist(dataset.id()), H5Pclose);
  if (!is_number(type.id())) refuse(name, "values of another type", "numbers");
  const Handle owner(H5Iget_file_id(dataset.id()), H5Fclose);
  hsize_t file_size = 0;
  require(H5Fget_filesize(owner.id(), &file_size) >= 0, name);
  const std::uint64_t packed = H5Pget_nfilters(properties.id()) > 0 ? kMostPacked : 1;
  const std::uint64_t stored = std::min<std::uint64_t>(H5Dget_storage_size(dataset.id()), file_size);
  const std::uint64_t values = saturated_product(shape.rows, static_cast<std::uint64_t>(std::max(shape.columns, 1)));
  if (saturated_product(values, H5Tget_size(type.id())) > saturated_product(stored, packed))
    refuse(name, fmt::format("{} values in {} bytes", values, stored), "as many as there is room for in the file");
  std::array<hsize_t, 2> chunk = {1, 1};
  if (H5Pget_layout(properties.id()) != H5D_CHUNKED) return;
  const int rank = H5Pget_chunk(properties.id(), 2, chunk.data());
  require(rank == 1 || rank == 2, name);
  if (saturated_product(chunk[0], chunk[1]) > saturated_product(file_size, kMostPacked))
    refuse(name, fmt::format("chunks of {} x {} values", chunk[0], chunk[1]), "ones that the file can hold");
}

Shape File::shape(const std::string& name) const { return shape_of(open_dataset(name), name); }

template <typename T>
Table<T> File::read_raw(const std::string& name, hid_t type) const {
  const Handle dataset = open_dataset(name);
  const Shape shape = shape_of(dataset, name);
  check_room(dataset, shape, name);
  Table<T> table;
  table.columns = shape.columns;
  table.values.resize(shape.rows * static_cast<std::size_t>(std::max(shape.columns, 1)));
  if (!table.values.empty()) {
    require(H5Dread(dataset.id(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, table.values.data()) >= 0, name);
  }
  compare_digest(name, table.values.data(), table.values.size() * sizeof(T));
  return table;
}

Table<double> File::read_doubles(const std::string& name) const { return read_raw<double>(name, H5T_NATIVE_DOUBLE); }

Table<std::int64_t> File::read_integers(const std::string& name) const {
  return read_raw<std::int64_t>(name, H5T_NATIVE_INT64);
}

}  // namespace itr::hdf5
