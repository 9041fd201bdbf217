// A camera in one word.
#include "core/camera_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/error_of.h"

namespace tutti::internal {
namespace {

using ::testing::HasSubstr;

TEST(CameraText, HasFourNumbersOrALensToo) {
  const PinholeCamera plain = ParseCamera("500,501,320, 240");
  EXPECT_EQ(plain.fx, 500);
  EXPECT_EQ(plain.fy, 501);
  EXPECT_EQ(plain.cy, 240);
  EXPECT_EQ(plain.width, 0);
  EXPECT_EQ(plain.distortion, Distortion::kNone);
  const PinholeCamera lens = ParseCamera("500,500,320,240,-0.1,0.2,0,0.001,0.3");
  EXPECT_EQ(lens.distortion, Distortion::kRadTan);
  EXPECT_EQ(lens.coefficients, (DistortionCoefficients{-0.1, 0.2, 0, 0.001, 0.3}));
  EXPECT_EQ(ParseCamera("500,500,320,240,0,0,0,0").distortion, Distortion::kNone);
}

TEST(CameraText, ThatIsWrongIsNamedWithTheOption) {
  for (const auto& [text, what] : {std::pair("1,2,3", "has 3 numbers"),
                                   {"1,2,3,4,5", "has 5 numbers"},
                                   {"1,x,3,4", "'x' is no number"},
                                   {"1,nan,3,4", "'nan' is no number"},
                                   {"", "'' is no number"},
                                   {"0,5,3,4", "fx and fy must be above 0"}}) {
    EXPECT_THAT(tutti::testing::ErrorOf([&, text = text] { ParseCamera(text, "--lens"); }),
                ::testing::AllOf(HasSubstr("--lens"), HasSubstr(what), HasSubstr("fx,fy,cx,cy")))
        << text;
  }
}

TEST(CameraText, WhatIsNoNumberOfPixelsIsOneThatNoCameraHas) {
  EXPECT_EQ(PixelsOf(640), 640);
  EXPECT_EQ(PixelsOf(0), 0);
  for (const double wrong :
       {-1.0, 1e9, 1e300, -1e300, static_cast<double>(INFINITY), static_cast<double>(NAN)})
    EXPECT_EQ(PixelsOf(wrong), -1) << wrong;
}

TEST(CameraText, SetsTheLensByTheNamesOfOtherPrograms) {
  const auto lens = [](const std::string& model, const std::vector<double>& values) {
    PinholeCamera camera;
    const std::string wrong = SetLens(model, values, camera);
    return wrong.empty() ? WordsOf(Distortion())[static_cast<std::size_t>(camera.distortion)].first : wrong;
  };
  for (const char* name : {"", "plumb_bob", "PinHole", "radial-tangential", "RS2_DISTORTION_BROWN_CONRADY"})
    EXPECT_EQ(lens(name, {0.1, 0, 0, 0}), "radtan") << name;
  for (const char* name : {"KannalaBrandt8", "equi", "Kannala-Brandt", "OPENCV_FISHEYE", "kb4"})
    EXPECT_EQ(lens(name, {0, 0, 0, 0}), "equidistant") << name << ": no pinhole, also without terms";
  EXPECT_EQ(lens("distortion.inverse_brown_conrady", {0, 0, 0, 0, 0}), "none");
  EXPECT_THAT(lens("distortion.inverse_brown_conrady", {0.1, 0, 0, 0, 0}),
              HasSubstr("is none that tutti has"));
  EXPECT_EQ(lens("modified_brown_conrady", {0.1, 0, 0, 0, 0}), "radtan");
  EXPECT_THAT(lens("modified_brown_conrady", {0.1, 0, 0.1, 0, 0}), HasSubstr("with p1 and p2"));
  EXPECT_EQ(lens("rational_polynomial", {0.1, 0, 0, 0, 0, 0, 0, 0}), "radtan");
  EXPECT_THAT(lens("rational_polynomial", {0.1, 0, 0, 0, 0, 0, 0.2, 0}), HasSubstr("number 7 is not 0"));
  EXPECT_THAT(lens("omni", {0, 0, 0, 0}), HasSubstr("'omni' is none that tutti has"));
  EXPECT_EQ(lens("a name of one's own", {0, 0, 0, 0}), "none");
  EXPECT_THAT(lens("none", {0.1, 0, 0, 0}), HasSubstr("not 0"));
}

}  // namespace
}  // namespace tutti::internal
