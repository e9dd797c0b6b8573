#include "pencilscan/capture/live_figures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "pencilscan/capture/camera_picture.h"

namespace pencilscan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Stripes of 10 px whose edges are blurred by a box so wide.
CameraFrame stripes(int edge_px, double bright = 200, double dark = 10) {
  cv::Mat wide(200, 320, CV_32FC3);
  for (int x = 0; x < wide.cols; ++x)
    wide.col(x).setTo(cv::Scalar::all(x / 20 % 2 == 0 ? bright : dark));
  cv::Mat blurred;
  cv::blur(wide, blurred, {edge_px, 1});
  CameraFrame frame;
  blurred.convertTo(frame.image, CV_8U);
  return frame;
}

TEST(LiveFigures, EdgesAreAsWideAsTheyAre) {
  for (const int width : {1, 2, 4, 6})
    EXPECT_NEAR(live_figures(stripes(width)).edge_px, width, 0.1 * width) << width;
  EXPECT_EQ(live_figures(stripes(1, 100, 100)).edge_px, 0);
}

TEST(LiveFigures, LightIsCounted) {
  const LiveFigures figures = live_figures(stripes(1, 204, 51));
  EXPECT_NEAR(figures.brightest, 0.8, 0.01);
  EXPECT_EQ(figures.saturated, 0);
  EXPECT_NEAR(figures.lit, 1, 0.01);
  EXPECT_NEAR(figures.line_contrast, 0.6, 0.02);
  EXPECT_NEAR(live_figures(stripes(1, 255, 10)).saturated, 0.5, 0.05);
}

TEST(LiveFigures, AdviceNamesWhatToTurn) {
  EXPECT_THAT(advice_for(live_figures(stripes(2)), true), IsEmpty());
  EXPECT_THAT(advice_for(live_figures(stripes(1, 255, 10)), true),
              ElementsAre(HasSubstr("half the exposure")));
  EXPECT_THAT(advice_for(live_figures(stripes(1, 60, 5)), true),
              ElementsAre(HasSubstr("open the iris")));
  EXPECT_THAT(advice_for(live_figures(stripes(6)), true), ElementsAre(HasSubstr("turn the focus")));
  EXPECT_THAT(advice_for(live_figures(stripes(1, 200, 120)), true),
              ElementsAre(HasSubstr("stand out")));
  EXPECT_THAT(advice_for(live_figures(stripes(1, 200, 120)), false), IsEmpty());
}

TEST(LiveFigures, MosaicsAreLookedAtInCells) {
  CameraFrame frame = stripes(4);
  cv::cvtColor(frame.image, frame.image, cv::COLOR_RGB2GRAY);
  frame.mosaic = "RGGB";
  EXPECT_NEAR(live_figures(frame).edge_px, 4, 1);
  EXPECT_EQ(preview_of(frame, 80).size(), cv::Size(80, 50));
  EXPECT_EQ(preview_of(frame, 80).type(), CV_8UC3);
}

TEST(PicturesForFiles, KeepTheMosaicThatTheRigStates) {
  CameraFrame frame;
  frame.image = cv::Mat(60, 80, CV_8UC1, cv::Scalar(200));
  frame.mosaic = "RGGB";
  Camera camera;
  EXPECT_EQ(picture_for_files(camera, frame).channels(), 3);
  camera.mosaic = Mosaic::from_name("RGGB");
  EXPECT_EQ(picture_for_files(camera, frame).channels(), 1);
}

TEST(LiveFigures, PreviewsLeaveThePictureAlone) {
  CameraFrame frame;
  frame.image = cv::Mat(60, 80, CV_8UC3, cv::Scalar(200, 100, 0));
  EXPECT_FALSE(preview_jpeg(frame, 640).empty());
  EXPECT_EQ(frame.image.at<cv::Vec3b>(5, 5), cv::Vec3b(200, 100, 0));
}

CameraFrame noisy(double mean, double deviation) {
  CameraFrame frame;
  frame.image = cv::Mat(200, 320, CV_8UC3);
  cv::theRNG().state = 1;
  cv::randn(frame.image, cv::Scalar::all(mean), cv::Scalar::all(deviation));
  return frame;
}

TEST(LiveFigures, OfABlackPictureNothingIsSaid) {
  CameraFrame frame = noisy(2, 1.5);
  EXPECT_EQ(live_figures(frame).lit, 0);
  EXPECT_EQ(live_figures(frame).line_contrast, 0);
  frame.image += cv::Scalar::all(16);  // a black level
  EXPECT_GT(live_figures(frame).lit, 0);
  EXPECT_EQ(live_figures(frame, 16.0 / 255).lit, 0);
  EXPECT_EQ(live_figures(frame, 16.0 / 255).line_contrast, 0);
}

TEST(LiveFigures, NoiseHasNoEdges) { EXPECT_EQ(live_figures(noisy(4, 2)).edge_px, 0); }

}  // namespace
}  // namespace pencilscan
