#include "pencilscan/capture/gathering.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pencilscan/capture/clock_fit.h"
#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kSecond = 1'000 * kMs;

/// A camera as the network shows it.
struct Source {
  double ppm = 0;             ///< its clock is fast by
  std::int64_t start_ns = 0;  ///< its clock at the host's 0
  std::int64_t phase_ns = 0;  ///< of its exposures
  std::int64_t transfer_ns = 20 * kMs;
  double jitter_ns = 3.0 * kMs;  ///< mean of what transfers take longer (exponential)
  std::int64_t first_number = 0;

  [[nodiscard]] CameraFrame picture(int k, std::int64_t period, Random& random) const {
    const std::int64_t begin = k * period + phase_ns;
    CameraFrame frame;
    frame.number = first_number + k;
    frame.timestamp_ns = start_ns + begin + std::llround(1e-6 * ppm * static_cast<double>(begin));
    frame.arrival_ns =
        begin + transfer_ns + std::llround(-jitter_ns * std::log(1 - random.uniform()));
    frame.image = cv::Mat(1, 1, CV_8UC1, cv::Scalar(k));
    return frame;
  }
};

struct Arrival {
  std::size_t camera = 0;
  CameraFrame frame;
};

/// All pictures of some cameras in the order of arrival.
std::vector<Arrival> arrivals(const std::vector<Source>& sources, int count, std::int64_t period) {
  std::vector<Arrival> all;
  Random random(3);
  for (std::size_t c = 0; c < sources.size(); ++c)
    for (int k = 0; k < count; ++k) all.push_back({c, sources[c].picture(k, period, random)});
  std::sort(all.begin(), all.end(), [](const Arrival& a, const Arrival& b) {
    return a.frame.arrival_ns < b.frame.arrival_ns;
  });
  return all;
}

GatheringOptions options_for(std::size_t cameras) {
  GatheringOptions options;
  for (std::size_t c = 0; c < cameras; ++c) options.cameras.push_back("cam" + std::to_string(c));
  options.rate_hz = 10;
  return options;
}

/// Frames given out as pictures arrive, and what is left at the end.
std::vector<GatheredFrame> gather(FrameGathering& gathering, std::vector<Arrival> all) {
  std::vector<GatheredFrame> frames;
  const auto append = [&](std::vector<GatheredFrame> more) {
    for (GatheredFrame& frame : more) frames.push_back(std::move(frame));
  };
  for (Arrival& arrival : all) {
    const std::int64_t now = arrival.frame.arrival_ns;
    gathering.add(arrival.camera, std::move(arrival.frame));
    append(gathering.take(now));
  }
  append(gathering.take(INT64_MAX / 2));
  return frames;
}

int content(const GatheredFrame& frame, std::size_t camera) {
  return frame.frames[camera]->image.at<std::uint8_t>(0, 0);
}

std::vector<std::string> kinds(const std::vector<Fault>& faults) {
  std::vector<std::string> result;
  for (const Fault& fault : faults) result.push_back(fault.device + " " + fault.kind);
  return result;
}

TEST(ClockFit, FindsTheDriftThroughJitter) {
  for (const double ppm : {-900.0, 0.0, 40.0, 1000.0}) {
    Source source;
    source.ppm = ppm;
    source.start_ns = 7'000 * kSecond;
    ClockFit clock;
    Random random(5);
    for (int k = 0; k < 300; ++k) {
      const CameraFrame frame = source.picture(k, 100 * kMs, random);
      clock.add(frame.timestamp_ns, frame.arrival_ns);
    }
    ASSERT_TRUE(clock.drift());
    // Least delays of blocks of five pictures scatter by 0.6 ms; over 30 s that is some 20 ppm.
    EXPECT_NEAR(clock.drift()->ppm, ppm, 60) << ppm;
    EXPECT_LT(std::abs(clock.drift()->ppm - ppm), 4 * clock.drift()->sigma_ppm);
    const CameraFrame last = source.picture(299, 100 * kMs, random);
    EXPECT_NEAR(static_cast<double>(clock.host_from_camera(last.timestamp_ns)),
                299.0 * 100 * kMs + 20 * kMs, 2 * kMs);
  }
}

TEST(ClockFit, StartsAnewWhenTheClockIsSet) {
  ClockFit clock;
  clock.add(100 * kSecond, 5 * kSecond);
  clock.add(1 * kSecond, 6 * kSecond);
  EXPECT_EQ(clock.host_from_camera(2 * kSecond), 7 * kSecond);
}

TEST(ClockFit, StartsAnewWhenTheClockJumpsForward) {
  for (const std::int64_t jump : {kSecond, 3600 * kSecond, 1'700'000'000 * kSecond}) {
    ClockFit clock;
    for (int k = 0; k < 80; ++k) {
      const std::int64_t taken = k * 100 * kMs;
      const std::int64_t stamp = taken + (k < 40 ? 0 : jump);
      clock.add(stamp, taken + 20 * kMs);
      EXPECT_NEAR(static_cast<double>(clock.host_from_camera(stamp) - taken), 20.0 * kMs, kMs)
          << jump << " " << k;
    }
  }
}

TEST(ClockFit, PicturesThatWaitedAreNoNewClock) {
  ClockFit clock;
  for (int k = 0; k < 36; ++k) {
    const std::int64_t taken = k * 100 * kMs;
    clock.add(taken, taken + (k >= 10 && k < 15 ? 400 : 20) * kMs);
  }
  EXPECT_TRUE(clock.drift());  // of three seconds and a half: none of them was given up
}

TEST(FrameGathering, PutsPicturesTogetherByTimeAndNotByNumber) {
  // As fake cameras of Aravis do: equal numbers up to a period apart.
  std::vector<Source> sources(3);
  sources[1].first_number = 2;
  sources[1].start_ns = -9 * kSecond;
  sources[2].first_number = -1;
  sources[2].phase_ns = 8 * kMs;
  FrameGathering gathering(options_for(3));
  const auto frames = gather(gathering, arrivals(sources, 50, 100 * kMs));
  ASSERT_EQ(frames.size(), 50U);
  for (const GatheredFrame& frame : frames) {
    ASSERT_TRUE(frame.whole());
    EXPECT_EQ(content(frame, 0), content(frame, 1));
    EXPECT_EQ(content(frame, 0), content(frame, 2));
  }
  EXPECT_THAT(gathering.faults(frames.back().time_ns), IsEmpty());
}

TEST(FrameGathering, MeasuresHowFarApartPicturesAre) {
  std::vector<Source> sources(2);
  sources[1].phase_ns = 30 * kMs;
  sources[0].jitter_ns = sources[1].jitter_ns = 0;
  sources[1].transfer_ns = sources[0].transfer_ns;
  GatheringOptions options = options_for(2);
  options.one_clock = true;
  options.max_spread_ms = 5;
  FrameGathering gathering(options);
  const auto frames = gather(gathering, arrivals(sources, 20, 100 * kMs));
  for (const GatheredFrame& frame : frames) {
    EXPECT_NEAR(frame.spread_ms, 30, 0.1);
    EXPECT_FALSE(frame.whole());
  }
  EXPECT_NEAR(gathering.spread().median_ms, 30, 0.1);
  EXPECT_THAT(kinds(gathering.faults(frames.back().time_ns)), ::testing::ElementsAre(" spread"));
}

TEST(FrameGathering, OneTriggerMakesTransfersOfDifferentLengthOneMoment) {
  std::vector<Source> sources(2);
  sources[1].transfer_ns = 45 * kMs;  // the second camera waits for the wire
  GatheringOptions options = options_for(2);
  options.one_trigger = true;
  options.max_spread_ms = 10;
  FrameGathering gathering(options);
  const auto frames = gather(gathering, arrivals(sources, 100, 100 * kMs));
  EXPECT_EQ(frames.size(), 100U);
  EXPECT_LT(frames.back().spread_ms, 3);
}

TEST(FrameGathering, NamesWhatIsMissing) {
  std::vector<Source> sources(3);
  auto all = arrivals(sources, 40, 100 * kMs);
  for (Arrival& arrival : all) {
    if (arrival.camera != 1 || arrival.frame.number % 10 != 3) continue;
    arrival.frame.status = PictureStatus::kLostPackets;
    arrival.frame.image.release();
    arrival.frame.timestamp_ns = -1;
  }
  std::erase_if(all, [](const Arrival& arrival) {
    return arrival.camera == 2 && arrival.frame.number == 20;
  });
  FrameGathering gathering(options_for(3));
  const auto frames = gather(gathering, all);
  ASSERT_EQ(frames.size(), 40U);
  int missing = 0;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    EXPECT_EQ(frames[k].missing[1], k % 10 == 3 ? "packets lost" : "") << k;
    EXPECT_EQ(frames[k].missing[2], k == 20 ? "no picture came" : "") << k;
    if (!frames[k].whole()) ++missing;
  }
  EXPECT_EQ(missing, 5);
  EXPECT_EQ(gathering.tallies()[1].incomplete, 4U);
  EXPECT_EQ(gathering.tallies()[2].skipped, 1U);
  EXPECT_THAT(kinds(gathering.faults(frames.back().time_ns)),
              ::testing::UnorderedElementsAre("cam1 lost_packets", "cam2 skipped"));
}

TEST(FrameGathering, NamesADeadCamera) {
  const std::vector<Source> sources(2);
  auto all = arrivals(sources, 30, 100 * kMs);
  std::erase_if(all, [](const Arrival& a) { return a.camera == 1 && a.frame.number >= 10; });
  FrameGathering gathering(options_for(2));
  const auto frames = gather(gathering, all);
  EXPECT_EQ(frames.size(), 30U);
  const auto faults = gathering.faults(3 * kSecond);
  ASSERT_EQ(faults.size(), 1U);
  EXPECT_EQ(faults[0].kind, "dead");
  EXPECT_EQ(faults[0].device, "cam1");
  EXPECT_THAT(faults[0].what, HasSubstr("no picture since 2.1 s"));
}

TEST(FrameGathering, NamesACameraThatNeverCame) {
  std::vector<Source> sources(2);
  auto all = arrivals(sources, 30, 100 * kMs);
  std::erase_if(all, [](const Arrival& a) { return a.camera == 0; });
  FrameGathering gathering(options_for(2));
  (void)gather(gathering, all);
  const auto faults = gathering.faults(3 * kSecond);
  ASSERT_EQ(faults.size(), 1U);
  EXPECT_EQ(faults[0].what, "no picture at all");
}

TEST(FrameGathering, FollowsADriftAndNamesOneThatNoCrystalHas) {
  std::vector<Source> sources(3);
  sources[1].ppm = 90;
  sources[2].ppm = 1000;
  FrameGathering gathering(options_for(3));
  const auto frames = gather(gathering, arrivals(sources, 200, 100 * kMs));
  EXPECT_EQ(frames.size(), 200U);
  EXPECT_LT(frames.back().spread_ms, 10);  // 1000 ppm of 20 s are 20 ms
  const auto faults = gathering.faults(frames.back().time_ns);
  ASSERT_THAT(kinds(faults), ::testing::ElementsAre("cam2 clock"));
  EXPECT_THAT(faults[0].what, ::testing::ContainsRegex("its clock runs 0.1[0-9]* % too fast"));
}

TEST(FrameGathering, NamesAClockThatPtpDidNotSet) {
  std::vector<Source> sources(2);
  sources[1].start_ns = 1'300 * kMs;
  GatheringOptions options = options_for(2);
  options.one_clock = true;
  FrameGathering gathering(options);
  (void)gather(gathering, arrivals(sources, 30, 100 * kMs));
  const auto faults = gathering.faults(3 * kSecond);
  ASSERT_THAT(kinds(faults), ::testing::Contains("cam1 clock"));
  const auto clock = std::find_if(faults.begin(), faults.end(),
                                  [](const Fault& fault) { return fault.kind == "clock"; });
  EXPECT_THAT(clock->what, HasSubstr("1.3 s apart"));
}

}  // namespace
}  // namespace pencilscan
