// SPDX-License-Identifier: MIT
// Files that were made to mislead: extents without values, links and storage elsewhere, attributes of other shapes; and
// damage, which digests tell.
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include "core/hdf5.hpp"
#include "itr/core.hpp"
#include "temporary_path.hpp"

namespace itr::hdf5 {
namespace {

namespace fs = std::filesystem;

class Hdf5Test : public ::testing::Test {
 protected:
  Hdf5Test() {
    fs::create_directories(folder);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~Hdf5Test() override { fs::remove_all(folder); }

  /// A file that make() fills by HDF5's own functions.
  template <typename Make>
  fs::path crafted(const Make& make) const {
    const fs::path path = folder / "crafted.h5";
    const Handle file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose);
    make(file.id());
    return path;
  }

  template <typename Read>
  static std::string refusal(const Read& read) {
    try {
      read();
    } catch (const InputError& error) {
      return error.what();
    }
    return "read";
  }
  static std::string refusal_of_values(const fs::path& path, const std::string& name = "/values") {
    const Session session;
    return refusal([&] { File::open(path).read_doubles(name); });
  }

  const fs::path folder = temporary_path();
};

Handle make_dataset(hid_t file, const char* name, const std::array<hsize_t, 2>& extent, hid_t properties, hid_t type) {
  const Handle space(H5Screate_simple(2, extent.data(), nullptr), H5Sclose);
  return {H5Dcreate2(file, name, type, space.id(), H5P_DEFAULT, properties, H5P_DEFAULT), H5Dclose};
}

TEST_F(Hdf5Test, ExtentsAreComparedWithWhatTheFileHolds) {
  const Handle chunked(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  constexpr std::array<hsize_t, 2> kChunk = {1, 1024};
  H5Pset_chunk(chunked.id(), 2, kChunk.data());
  using Extent = std::array<hsize_t, 2>;
  for (const Extent& extent : {Extent{1, (hsize_t{1} << 32) + 2}, Extent{hsize_t{1} << 40, 3}, Extent{1 << 30, 3},
                               Extent{hsize_t{1} << 31, hsize_t{1} << 31}, Extent{1 << 30, 1 << 30}}) {
    const fs::path path =
        crafted([&](hid_t file) { make_dataset(file, "/values", extent, chunked.id(), H5T_NATIVE_DOUBLE); });
    ASSERT_LT(fs::file_size(path), 100000u);
    const std::string message = refusal_of_values(path);
    EXPECT_NE(message.find("/values: found"), std::string::npos) << message;
  }
}

TEST_F(Hdf5Test, PackedValuesAreRead) {
  const Handle packed(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  constexpr std::array<hsize_t, 2> kExtent = {5000, 2};
  H5Pset_chunk(packed.id(), 2, kExtent.data());
  if (H5Zfilter_avail(H5Z_FILTER_DEFLATE) <= 0)
    GTEST_SKIP() << "a machine whose HDF5 has no deflate filter does without: nothing is stored compressed there";
  H5Pset_deflate(packed.id(), 9);
  const std::vector<double> zeros(10000);
  const fs::path path = crafted([&](hid_t file) {
    const Handle set = make_dataset(file, "/values", kExtent, packed.id(), H5T_NATIVE_DOUBLE);
    H5Dwrite(set.id(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, zeros.data());
  });
  EXPECT_EQ(refusal_of_values(path), "read");
}

TEST_F(Hdf5Test, OtherFilesAreNotRead) {
  {
    const Session session;
    File other = File::create(folder / "other.h5");
    other.write("/group/values", std::array{1.0, 2.0}, 0);
    std::ofstream(folder / "other.h5", std::ios::binary) << other.image();
  }
  std::ofstream(folder / "secret.raw", std::ios::binary) << std::string(16, 'x');
  const fs::path linked = crafted([](hid_t file) {
    H5Lcreate_external("other.h5", "/group/values", file, "/values", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_external("other.h5", "/group", file, "/group", H5P_DEFAULT, H5P_DEFAULT);
  });
  for (const char* name : {"/values", "/group/values"})
    EXPECT_NE(refusal_of_values(linked, name).find("a link to another file"), std::string::npos) << name;
  {
    const Session session;
    const File file = File::open(linked);
    EXPECT_NE(refusal([&] { (void)file.contains("/group/values"); }).find("a link to another file"), std::string::npos);
    EXPECT_EQ(File::open(linked, OtherFiles::followed).read_doubles("/group/values").values.size(), 2u);
  }
  const fs::path stored = crafted([&](hid_t file) {
    const Handle external(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    H5Pset_external(external.id(), (folder / "secret.raw").c_str(), 0, 16);
    make_dataset(file, "/values", {1, 2}, external.id(), H5T_NATIVE_DOUBLE);
  });
  EXPECT_NE(refusal_of_values(stored).find("stored in another file"), std::string::npos);
  const fs::path is_virtual = crafted([&](hid_t file) {
    const Handle elsewhere(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    constexpr hsize_t kTwo = 2;
    const Handle space(H5Screate_simple(1, &kTwo, nullptr), H5Sclose);
    H5Pset_virtual(elsewhere.id(), space.id(), "other.h5", "/group/values", space.id());
    const Handle set(H5Dcreate2(file, "/values", H5T_NATIVE_DOUBLE, space.id(), H5P_DEFAULT, elsewhere.id(), H5P_DEFAULT),
                     H5Dclose);
  });
  EXPECT_NE(refusal_of_values(is_virtual).find("stored in another file"), std::string::npos);
}

TEST_F(Hdf5Test, AttributesAreOfOneNumber) {
  const fs::path path = crafted([](hid_t file) {
    const hsize_t many = 1000;
    const std::vector<double> values(many, 1.0);
    const Handle space(H5Screate_simple(1, &many, nullptr), H5Sclose);
    const Handle attribute(H5Acreate2(file, "t", H5T_NATIVE_DOUBLE, space.id(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    H5Awrite(attribute.id(), H5T_NATIVE_DOUBLE, values.data());
    const Handle text(H5Tcopy(H5T_C_S1), H5Tclose), one(H5Screate(H5S_SCALAR), H5Sclose);
    H5Tset_size(text.id(), 8);
    const Handle name(H5Acreate2(file, "unit", text.id(), one.id(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  });
  const Session session;
  const File file = File::open(path);
  EXPECT_THROW(file.read_double_attribute("t"), InputError);
  EXPECT_THROW(file.read_integer_attribute("t"), InputError);
  EXPECT_THROW(file.read_integer_attribute("unit"), InputError);
  EXPECT_THROW(file.read_text_attribute("/", "unit"), InputError);
  EXPECT_THROW(file.read_text_attribute("/", "t"), InputError);
}

TEST_F(Hdf5Test, TextIsNoNumber) {
  const fs::path path = crafted([](hid_t file) {
    const Handle text(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_size(text.id(), H5T_VARIABLE);
    make_dataset(file, "/values", {2, 2}, H5P_DEFAULT, text.id());
  });
  EXPECT_NE(refusal_of_values(path), "read");
}

TEST_F(Hdf5Test, DamageIsTold) {
  const fs::path path = folder / "made.h5";
  {
    const Session session;
    File file = File::create(path);
    file.write("/a/x", std::array{1.25, 2.5, 3.75}, 0);
    file.write("/a/n", std::array{std::int64_t{7}, std::int64_t{8}}, 2);
    file.write_text("/a/text", "some words");
    file.write_attribute("step", std::int64_t{12345});
    std::ofstream(path, std::ios::binary) << file.image();
    file.write("/a/x", std::array{1.25, 2.5, 4.0}, 0);  // as frames of one shape are written one after another
    std::ofstream(path, std::ios::binary) << file.image();
  }
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  const std::string bytes = text.str();
  const auto damage_at = [&](const void* pattern, std::size_t size) {
    std::string changed = bytes;
    const std::size_t at = changed.rfind(std::string_view(static_cast<const char*>(pattern), size));
    EXPECT_NE(at, std::string::npos);
    changed[at] = static_cast<char>(changed[at] ^ 1);
    std::ofstream(path, std::ios::binary) << changed;
    const Session session;
    return File::open(path).find_damage();
  };
  using Names = std::vector<std::string>;
  {
    const Session session;
    const File file = File::open(path);
    EXPECT_EQ(file.find_damage(), Names{});
    EXPECT_EQ(file.read_doubles("/a/x").values[2], 4.0);
    EXPECT_EQ(file.read_text("/a/text"), "some words");
  }
  const double number = 2.5;
  const std::int64_t integer = 7, step = 12345;
  EXPECT_EQ(damage_at(&integer, 8), Names{"/a/n"});
  EXPECT_EQ(damage_at(&step, 8), Names{"attribute step"});
  EXPECT_EQ(damage_at("some words", 10), Names{"/a/text"});
  EXPECT_EQ(damage_at(&number, 8), Names{"/a/x"});
  const Session session;
  const File file = File::open(path);
  EXPECT_NE(refusal([&] { file.read_doubles("/a/x"); }).find("the file is damaged"), std::string::npos);
  EXPECT_EQ(file.read_integers("/a/n").values[1], 8);
}

TEST_F(Hdf5Test, FilesOfOneNameAreMadeSideBySide) {
  const Session session;
  File first = File::create("frames/000001.h5"), second = File::create("frames/000001.h5");
  first.write("/x", std::array{1.0}, 0);
  second.write("/x", std::array{2.0}, 0);
  EXPECT_NE(first.image(), second.image());
}

}  // namespace
}  // namespace itr::hdf5
