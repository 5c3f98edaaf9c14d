// SPDX-License-Identifier: MIT
// The little of HDF5 that we need, with failures as InputError and handles that close themselves.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace itr::hdf5 {

/// Owns an HDF5 identifier.
class Handle {
 public:
  using Close = herr_t (*)(hid_t);
  Handle(hid_t id, Close close) : id_(id), close_(close) {}
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle& operator=(Handle&&) = delete;
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  hid_t id() const { return id_; }
  bool is_valid() const { return id_ >= 0; }

 private:
  hid_t id_;
  Close close_;
};

/// While it lives, this thread alone is inside HDF5 (the serial library is not re-entrant, and two simulations of one
/// process must not meet there) and HDF5 does not print its error stack.
class Session {
 public:
  Session();
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

 private:
  std::unique_lock<std::mutex> lock_;
  H5E_auto2_t print_ = nullptr;
  void* print_data_ = nullptr;
};

/// Rows x columns; columns = 0 stands for a plain vector.
struct Shape {
  std::size_t rows = 0;
  int columns = 0;
};

/// The values of a dataset, row-major; columns as in Shape.
template <typename T>
struct Table {
  std::vector<T> values;
  int columns = 0;
  std::size_t rows() const { return columns ? values.size() / columns : values.size(); }
};

/// Whether a file that is read may send its reader to others, by links to them.
enum class OtherFiles { refused, followed };

/// A file that is read, or one that is being made in memory: HDF5 itself never writes to a disk, as it does not get over a
/// full one. Names of datasets are full paths; groups are made on the way. What is made has the dataset /digests, lines of a
/// name and a digest of its values, by which damage is told when it is read. Readers take nothing on trust: extents are
/// compared with what the file can hold before room is made for them.
class File {
 public:
  /// `path` is for messages only.
  static File create(const std::filesystem::path& path);
  static File open(const std::filesystem::path& path, OtherFiles others = OtherFiles::refused);

  /// Replaces a dataset of this name and shape, which is much cheaper than in a new file.
  void write(const std::string& name, std::span<const double> values, int columns);
  void write(const std::string& name, std::span<const std::int64_t> values, int columns);
  /// Writes or replaces an attribute of the file.
  void write_attribute(const char* name, double value);
  void write_attribute(const char* name, std::int64_t value);
  /// The numbers of an attribute of a group or dataset that is there.
  void write_attribute(const std::string& object, const char* name, std::span<const std::int64_t> values);
  /// Text of a dataset that is there: its unit, say.
  void write_attribute(const std::string& object, const char* name, const std::string& text);
  void unlink(const std::string& name);
  void write_text(const std::string& name, const std::string& text);
  bool has_written(const std::string& name) const { return written_.contains(name); }
  /// The bytes of the file that was created, as far as it is.
  std::string image();

  bool contains(const std::string& name) const;
  /// Whether damage can be told.
  bool has_digests() const { return !digests_.empty(); }
  /// Names of what has a digest; attributes of the file as "@name".
  std::vector<std::string> digest_names() const;
  bool holds_text(const std::string& name) const;
  bool holds_integers(const std::string& name) const;
  /// Names of what is not as it was written; empty also without digests.
  std::vector<std::string> find_damage() const;
  std::int64_t read_integer_attribute(const char* name) const;
  double read_double_attribute(const char* name) const;
  std::vector<std::int64_t> read_integers_attribute(const std::string& object, const char* name) const;
  std::string read_text(const std::string& name) const;
  std::string read_text_attribute(const std::string& object, const char* name) const;
  /// Returns a dataset's shape without reading it.
  Shape shape(const std::string& name) const;
  Table<double> read_doubles(const std::string& name) const;
  Table<std::int64_t> read_integers(const std::string& name) const;

 private:
  File(std::filesystem::path path, Handle file);
  void require(bool ok, const std::string& what) const;
  [[noreturn]] void refuse(const std::string& what, const std::string& found, const std::string& expected) const;
  void read_digests();
  void compare_digest(const std::string& name, const void* values, std::size_t bytes) const;
  void compare_attribute(const char* name) const;
  void write_raw(const std::string& name, hid_t type, const void* values, std::size_t size, int columns);
  void write_attribute_raw(const char* name, hid_t type, const void* value);
  Handle open_attribute(const std::string& object, const char* name) const;
  void read_attribute_raw(const char* name, hid_t type, void* value) const;
  Handle open_dataset(const std::string& name) const;
  Shape shape_of(const Handle& dataset, const std::string& name) const;
  /// Throws where the file cannot hold so many values.
  void check_room(const Handle& dataset, const Shape& shape, const std::string& name) const;
  template <typename T>
  Table<T> read_raw(const std::string& name, hid_t type) const;

  struct Written {
    Handle set;
    std::size_t size;
    int columns;
    std::uint64_t digest;
  };
  struct WrittenAttribute {
    Handle attribute;
    std::uint64_t digest;
  };

  std::filesystem::path path_;
  std::unique_ptr<bool> left_file_;  ///< whether a link led out of the file; its address names a file in memory
  Handle file_;
  Handle access_;                                       ///< properties of how links are followed
  std::map<std::string, Written> written_;              ///< datasets, by name
  std::map<std::string, WrittenAttribute> attributes_;  ///< of the file, written here
  std::map<std::string, std::uint64_t> digests_;        ///< of what is read, by name; attributes as "@name"
};

}  // namespace itr::hdf5
