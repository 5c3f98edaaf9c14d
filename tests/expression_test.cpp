// SPDX-License-Identifier: MIT
// Values that scenes write instead of numbers: expressions, and interpolations in time.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "itr/core.hpp"
#include "scene/expression.hpp"
#include "scene/interpolation.hpp"
#include "scene/node.hpp"

namespace itr::scene {
namespace {

using nlohmann::json;

double evaluate(const std::string& text, double x = 0, double y = 0, double z = 0, double t = 0) {
  return Expression(text)({x, y, z, t});
}

TEST(Expression, OperatorsAsTinyexpr) {
  EXPECT_EQ(evaluate("-2^2"), 4);
  EXPECT_EQ(evaluate("2^3^2"), 64);
  EXPECT_EQ(evaluate("2^-1"), 0.5);
  EXPECT_EQ(evaluate("7 % 4 - 2 * 3 / 4"), 1.5);
  EXPECT_EQ(evaluate("--1 + +.5e1"), 6);
  EXPECT_EQ(evaluate("(1, 2) + 1"), 3);
  EXPECT_EQ(evaluate("x + 10*y + 100*z + 1000*t", 1, 2, 3, 4), 4321);
}

TEST(Expression, Functions) {
  EXPECT_EQ(evaluate("log(100)"), 2);
  EXPECT_NEAR(evaluate("ln(e)"), 1, 1e-15);
  EXPECT_NEAR(evaluate("sin pi"), 0, 1e-15);
  EXPECT_EQ(evaluate("if(0, 1, 2)"), 1);
  EXPECT_EQ(evaluate("if(-1, 1, 2)"), 2);
  EXPECT_EQ(evaluate("min(3, max(1, 2)) + sign(-4) + sign(0)"), 1);
  EXPECT_NEAR(evaluate("smooth_abs(-0.3, 5)"), -0.3 * std::tanh(-1.5), 1e-15);
  EXPECT_NEAR(evaluate("rotate_2D_x(1, 0, pi/2)"), 0, 1e-15);
  EXPECT_NEAR(evaluate("rotate_2D_y(1, 0, deg2rad(90))"), 1, 1e-15);
  EXPECT_EQ(evaluate("fac(5) + ncr(5, 2) + npr(5, 2)"), 150);
  EXPECT_EQ(evaluate("fac(1e9)"), INFINITY);
  EXPECT_EQ(evaluate("smoothstep(0.5) + compare(1, 2) + half_smoothstep(2)"), 2.5);
  EXPECT_EQ(evaluate("pi() - pi"), 0);
  EXPECT_TRUE(Expression("1e6 / 16").is_constant());
  EXPECT_FALSE(Expression("0 * t").is_constant());
}

TEST(Expression, KnowsPlainAnglesOfMoreThanATurn) {
  using Calls = std::vector<std::string>;
  EXPECT_EQ(Expression("9.81 * sin(30) + cos -45").large_angles(), (Calls{"sin(30)", "cos -45"}));
  for (const char* text : {"sin(6)", "sin(30 * t)", "sin(deg2rad(30))", "cosh(30)", "cos(30 + x)"})
    EXPECT_TRUE(Expression(text).large_angles().empty()) << text;
}

TEST(Expression, KnowsItsKinksInTime) {
  const auto kinks = [](const std::string& text) { return Expression(text).kinks(0, 10); };
  EXPECT_EQ(kinks("3 * t + sin(t)"), std::vector<double>{});
  EXPECT_EQ(kinks("x + y"), std::vector<double>{});
  EXPECT_EQ(kinks("if(t - 2.5, 1, t)"), std::vector<double>{2.5});
  const std::vector<double> found = kinks("min(t, 4) + max(0, t - 7)");
  ASSERT_EQ(found.size(), 2u);
  EXPECT_NEAR(found[0], 4, 1e-14);
  EXPECT_NEAR(found[1], 7, 1e-14);
  EXPECT_EQ(kinks("0.3 * smoothstep((t - 1) / 0.5)").size(), 2u);
  EXPECT_NEAR(kinks("abs(1 - t)").at(0), 1, 1e-12);
  EXPECT_EQ(kinks("floor(t / 3)"), (std::vector<double>{3, 6, 9}));
  EXPECT_EQ(kinks("t % 4"), (std::vector<double>{4, 8}));
  EXPECT_EQ(kinks("compare(t, 5) * compare(t, 5.004)").size(), 2u) << "within one sample";
  // Where the place decides too, nothing is known; what is beside it is.
  EXPECT_EQ(kinks("if(t - x, 1, 0)"), std::vector<double>{});
  EXPECT_EQ(kinks("x * if(t - 2, 1, 0) + (t, x) + (y, t - 1)"), std::vector<double>{2});
  EXPECT_EQ(kinks("if(x * 0 + if(t - 2, 1, -1), 1, 0)"), std::vector<double>{2});
}

TEST(Interpolation, KnowsItsKinks) {
  const auto kinks = [](const json& value) {
    const Document document{.file = {}, .root = {}, .json = value};
    return Interpolation(Node(document)).kinks(0, 10);
  };
  EXPECT_EQ(kinks({{"type", "none"}}), std::vector<double>{});
  EXPECT_EQ(kinks({{"type", "linear_ramp"}, {"from", 1}, {"to", 3}}), (std::vector<double>{1, 3}));
  const json table = {{"type", "piecewise_linear"}, {"points", {0, 1, 4}}, {"values", {0, 1, 0}}};
  EXPECT_EQ(kinks(table), (std::vector<double>{0, 1, 4}));
  json wave = table;
  wave["extend"] = "repeat";
  EXPECT_EQ(kinks(wave), (std::vector<double>{0, 1, 4, 4, 5, 8, 8, 9, 12}));
}

TEST(Expression, RefusesWhatItDoesNotKnow) {
  for (const char* text : {"", "1 +", "foo(1)", "min(1)", "min(1, 2, 3)", "2 2", "sin()", "(1", "x = 1", "X", "1..2", "if",
                           "0,5*t", "sin(t) + (1,5)"})
    EXPECT_THROW(Expression{text}, ExpressionError) << text;
  EXPECT_THROW(Expression(std::string(100000, '(')), ExpressionError);
  try {
    Expression("1 + smoth_abs(t, 1)");
    FAIL();
  } catch (const ExpressionError& error) {
    EXPECT_NE(std::string(error.what()).find("'smoth_abs' at character 5"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("smooth_abs"), std::string::npos);
  }
}

Interpolation interpolation(const json& text) {
  static Document document;  // outlives what is read from it
  document = {"test.json", "", text};
  return Interpolation(Node(document));
}

TEST(Interpolation, Ramps) {
  EXPECT_EQ(Interpolation()(3), 1);
  EXPECT_EQ(interpolation({{"type", "linear"}})(3), 3);
  const Interpolation ramp = interpolation({{"type", "linear_ramp"}, {"from", 1}, {"to", 3}});
  EXPECT_EQ(ramp(0), 0);
  EXPECT_EQ(ramp(2.5), 1.5);
  EXPECT_EQ(ramp(9), 2);
}

json piecewise(const char* type, const char* extend) {
  return {{"type", type}, {"points", {0, 1, 3}}, {"values", {0, 2, 1}}, {"extend", extend}};
}

TEST(Interpolation, PiecesAndTheirExtension) {
  EXPECT_EQ(interpolation(piecewise("piecewise_constant", "constant"))(0.999), 0);
  EXPECT_EQ(interpolation(piecewise("piecewise_constant", "constant"))(1), 2);
  EXPECT_EQ(interpolation(piecewise("piecewise_constant", "constant"))(3), 1);
  EXPECT_EQ(interpolation(piecewise("piecewise_constant", "repeat"))(3), 0);
  EXPECT_EQ(interpolation(piecewise("piecewise_linear", "constant"))(2), 1.5);
  EXPECT_EQ(interpolation(piecewise("piecewise_linear", "extrapolate"))(5), 0);
  EXPECT_EQ(interpolation(piecewise("piecewise_linear", "extrapolate"))(-1), -2);
  EXPECT_EQ(interpolation(piecewise("piecewise_linear", "repeat"))(3.5), 1);
  EXPECT_EQ(interpolation(piecewise("piecewise_linear", "repeat_offset"))(6.5), 3);
  EXPECT_EQ(interpolation(piecewise("piecewise_linear", "repeat_offset"))(-2), 1);
}

TEST(Interpolation, CubicIsTwiceDifferentiableWithTheEndsOfItsExtension) {
  const double h = 1e-4;
  for (const char* extend : {"constant", "extrapolate", "repeat", "repeat_offset"}) {
    const Interpolation g = interpolation(piecewise("piecewise_cubic", extend));
    const auto slope = [&](double t) { return (g(t + h) - g(t - h)) / (2 * h); };
    const auto curvature = [&](double t) { return (g(t + h) - 2 * g(t) + g(t - h)) / (h * h); };
    for (const auto& [point, value] : {std::pair{0., 0.}, {1., 2.}, {3. - 1e-12, 1.}}) EXPECT_NEAR(g(point), value, 1e-9);
    EXPECT_NEAR(slope(1 - 2 * h), slope(1 + 2 * h), 5e-3) << extend;
    EXPECT_NEAR(curvature(1 - 2 * h), curvature(1 + 2 * h), 1e-2) << extend;
    const double first = slope(2 * h), last = slope(3 - 2 * h);
    const bool is_clamped = extend == std::string("constant"), is_natural = extend == std::string("extrapolate");
    EXPECT_NEAR(last, is_clamped ? 0 : (is_natural ? slope(5) : first), 1e-2) << extend;
  }
}

TEST(Interpolation, RefusesPointsThatDoNotFit) {
  EXPECT_THROW(interpolation({{"type", "cubic"}}), InputError);
  EXPECT_THROW(interpolation({{"type", "piecewise_linear"}, {"points", {0, 0}}, {"values", {1, 2}}}), InputError);
  EXPECT_THROW(interpolation({{"type", "piecewise_linear"}, {"points", {0, 1}}, {"values", {1}}}), InputError);
}

}  // namespace
}  // namespace itr::scene
