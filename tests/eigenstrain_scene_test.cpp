// SPDX-License-Identifier: MIT
// The key `materials/eigenstrain`.
#include <gtest/gtest.h>

#include <string>

#include "scene_folder.hpp"

namespace itr::scene {
namespace {

class EigenstrainScene : public SceneTest {
 protected:
  /// The strain of the entry of `square` with these changes, at X and t.
  Mat<3> strain_of(const json& changes, const Vec<3>& X = Vec<3>(0.5, 0.25, 0), double t = 2) {
    json scene = square();
    scene["materials"][0].update(changes);
    const Material material = read2(scene).materials.at(1);
    return material.eigenstrain ? material.eigenstrain(X, t) : Mat<3>(Mat<3>::Zero());
  }
  InputError::Parts failure_of(const json& changes) {
    json scene = square();
    scene["materials"][0].update(changes);
    return failure(scene);
  }
};

TEST_F(EigenstrainScene, ReadsNumbersExpressionsAndTensors) {
  EXPECT_EQ(strain_of({{"eigenstrain", 0.01}}), Mat<3>(0.01 * Mat<3>::Identity()));
  EXPECT_EQ(strain_of({{"eigenstrain", "0.1*t*x"}}), Mat<3>(0.1 * 2 * 0.5 * Mat<3>::Identity()));
  EXPECT_EQ(strain_of({{"eigenstrain", {0.01, "y"}}}), Mat<3>(Vec<3>(0.01, 0.25, 0).asDiagonal()));
  Mat<3> tensor = Mat<3>::Zero();
  tensor.topLeftCorner<2, 2>() << 0.01, 0.5, 0.5, 0.02;
  EXPECT_EQ(strain_of({{"eigenstrain", {{0.01, "x"}, {"x", 0.02}}}}), tensor);
  tensor(2, 2) = 0.03;
  EXPECT_EQ(strain_of({{"plane_strain", true}, {"eigenstrain", {{0.01, "x", 0}, {"x", 0.02, 0}, {0, 0, 0.03}}}}), tensor);
  EXPECT_EQ(strain_of({{"eigenstrain", 0}}), Mat<3>(Mat<3>::Zero()));
  json scene = square();
  scene["materials"][0]["eigenstrain"] = "0.1*t";
  EXPECT_FALSE(read2(scene).materials.at(1).has_varying_moduli());
  scene["materials"][0]["eigenstrain"] = "0.1*x";
  EXPECT_TRUE(read2(scene).materials.at(1).has_varying_moduli());
}

TEST_F(EigenstrainScene, RefusesWhatItCannotMean) {
  EXPECT_EQ(failure_of({{"eigenstrain", -1}}).place, "/materials/0/eigenstrain");
  EXPECT_EQ(failure_of({{"eigenstrain", {{0.1, 0.2}, {0.3, 0.1}}}}).place, "/materials/0/eigenstrain/1/0");
  EXPECT_EQ(failure_of({{"eigenstrain", {{0.1, 0}, {0, 0.1, 0}}}}).place, "/materials/0/eigenstrain/1");
  EXPECT_EQ(failure_of({{"eigenstrain", {0.1, 0.1, 0.1}}}).place, "/materials/0/eigenstrain/2");  // in plane stress
  EXPECT_EQ(failure_of({{"plane_strain", true}, {"eigenstrain", {{0, 0, 0.1}, {0, 0, 0}, {0.1, 0, 0}}}}).place,
            "/materials/0/eigenstrain/2/0");
  EXPECT_EQ(failure_of({{"eigenstrain", {0.1, 0.1, 0.1, 0.1}}}).place, "/materials/0/eigenstrain");
  EXPECT_EQ(failure_of({{"eigenstrain", {{"a", 1}}}}).place, "/materials/0/eigenstrain");
  json plane = square();
  plane["materials"][0] = {
      {"type", "HookeLinearElasticity"}, {"elasticity_tensor", {3, 1, 0, 3, 0, 1}}, {"rho", 1}, {"eigenstrain", 0.1}};
  EXPECT_EQ(failure(plane).place, "/materials/0/eigenstrain");
  json three = square();
  three["geometry"][0]["mesh"] = "tet.msh";
  three["materials"][0]["eigenstrain"] = {0.1, 0.1};
  EXPECT_EQ(failure(three).place, "/materials/0/eigenstrain");
}

/// A value that goes wrong later is named with its place and time.
TEST_F(EigenstrainScene, NamesTheValueThatIsWrong) {
  for (const std::string value : {"-t", "1/(t-2)"}) {
    try {
      strain_of({{"eigenstrain", value}});
      FAIL() << value;
    } catch (const InputError& error) {
      EXPECT_EQ(error.parts().place, "/materials/0/eigenstrain");
      EXPECT_NE(error.parts().found.find("X = (0.5, 0.25, 0)"), std::string::npos) << error.parts().found;
      EXPECT_NE(error.parts().found.find("t = 2"), std::string::npos) << error.parts().found;
    }
  }
}

}  // namespace
}  // namespace itr::scene
