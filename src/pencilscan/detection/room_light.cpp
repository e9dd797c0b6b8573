#include "pencilscan/detection/room_light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "pencilscan/core/median.h"
#include "pencilscan/view/nearest.h"

namespace pencilscan {
namespace {

constexpr int kTile = 32;        // px: holds several lines
constexpr float kLit = 0.15F;    // of the brightest tile
constexpr float kOwn = 0.5F;     // of a pixel's brightest channel: room light more than others'
constexpr float kBright = 0.1F;  // of the brightest tile: what is fainter makes no ridge
constexpr int kAllDirections = 12;

/// In a range that pieces and disks can have. Of lines that are farther apart, crossings are still
/// shorter than two such pitches.
double usable_pitch(double pitch_px) { return std::min(20.0, std::max(4.0, pitch_px)); }

/// How long a straight piece is: two pitches, which hold the dark beside every line that crosses
/// it.
int piece_length(double pitch_px) {
  return 2 * nearest(static_cast<float>(usable_pitch(pitch_px))) + 1;
}

cv::Mat straight_piece(int length, double angle) {
  const int half = length / 2;
  const cv::Point middle(half, half);
  const cv::Point end(nearest(static_cast<float>(half * std::cos(angle))),
                      nearest(static_cast<float>(half * std::sin(angle))));
  cv::Mat piece(length, length, CV_8U, cv::Scalar(0));
  cv::line(piece, middle - end, middle + end, cv::Scalar(1));
  return piece;
}

/// The most that an image has over a whole straight piece through each pixel.
cv::Mat along_pieces(const cv::Mat& image, int length, int directions) {
  cv::Mat most(image.size(), CV_32F, cv::Scalar(0));
  cv::Mat opened;
  for (int k = 0; k < directions; ++k) {
    cv::morphologyEx(image, opened, cv::MORPH_OPEN,
                     straight_piece(length, k * std::numbers::pi / directions));
    cv::max(most, opened, most);
  }
  return most;
}

struct Extremes {
  cv::Mat least;
  cv::Mat most;
};

Extremes of_channels(const cv::Mat& light) {
  std::array<cv::Mat, 3> channel;
  cv::split(light, channel.data());
  return {cv::min(channel[0], cv::min(channel[1], channel[2])),
          cv::max(channel[0], cv::max(channel[1], channel[2]))};
}

/// Mean of the brightest channel in each tile; tiles at the right and lower edge are left out.
cv::Mat tile_means(const cv::Mat& most) {
  const cv::Size tiles(most.cols / kTile, most.rows / kTile);
  if (tiles.empty()) return {};
  cv::Mat means;
  cv::resize(most({0, 0, tiles.width * kTile, tiles.height * kTile}), means, tiles, 0, 0,
             cv::INTER_AREA);
  return means;
}

bool is_room_light(float room, float most, float brightest) {
  return room > kOwn * most && room > kBright * brightest;
}

/// Lit tiles, and how bright the brightest is.
struct LitTiles {
  std::vector<cv::Rect> tiles;
  float brightest = 0;
};

LitTiles lit_tiles(const cv::Mat& most) {
  LitTiles lit;
  const cv::Mat means = tile_means(most);
  if (means.empty()) return lit;
  double brightest = 0;
  cv::minMaxLoc(means, nullptr, &brightest);
  lit.brightest = static_cast<float>(brightest);
  for (int y = 0; y < means.rows; ++y) {
    for (int x = 0; x < means.cols; ++x) {
      if (means.at<float>(y, x) > kLit * lit.brightest)
        lit.tiles.emplace_back(x * kTile, y * kTile, kTile, kTile);
    }
  }
  return lit;
}

/// The room's light within a tile, noise smoothed.
struct RoomInTile {
  float share = 0;     ///< of the pixels: they have more of it than of other light
  float contrast = 0;  ///< of what nine tenths of the pixels have at most, how much a tenth lacks
};

RoomInTile room_in_tile(const cv::Mat& light, const cv::Rect& tile, float brightest, int length) {
  constexpr int kDirections = 6;
  constexpr double kSmooth = 0.7;  // px
  const cv::Rect around = cv::Rect(tile.x - length, tile.y - length, tile.width + 2 * length,
                                   tile.height + 2 * length) &
                          cv::Rect({0, 0}, light.size());
  cv::Mat smooth;
  cv::GaussianBlur(light(around), smooth, {0, 0}, kSmooth);
  const Extremes extremes = of_channels(smooth);
  const cv::Mat room = along_pieces(extremes.least, length, kDirections);
  const cv::Rect inner = tile - around.tl();
  int count = 0;
  std::vector<float> levels;
  for (int y = inner.y; y < inner.y + inner.height; ++y) {
    for (int x = inner.x; x < inner.x + inner.width; ++x) {
      levels.push_back(room.at<float>(y, x));
      count += is_room_light(levels.back(), extremes.most.at<float>(y, x), brightest);
    }
  }
  std::sort(levels.begin(), levels.end());
  const float high = levels[levels.size() * 9 / 10];
  const float low = levels[levels.size() / 10];
  return {static_cast<float>(count) / static_cast<float>(levels.size()),
          high > 0 ? 1 - low / high : 0};
}

/// What the room's light looks like where it is purest.
struct RoomColor {
  cv::Vec3f color;  ///< the brightest channel 1
  float most = 0;   ///< what its brightest channel has at the brightest places
};

/// Where lines of several colours lie over each other, they seem to be the room's, with colours of
/// their own and brighter: the purest quarter of the places says the colour and how bright it can
/// be.
std::optional<RoomColor> color_of_room(const cv::Mat& light, const Extremes& extremes,
                                       const cv::Mat& room, float brightest) {
  struct Place {
    float purity;
    float level;
    cv::Vec3f ratio;
  };
  std::vector<Place> places;
  for (int y = 0; y < light.rows; ++y) {
    for (int x = 0; x < light.cols; ++x) {
      const float most = extremes.most.at<float>(y, x);
      const float level = room.at<float>(y, x);
      if (is_room_light(level, most, brightest))
        places.push_back({level / most, level, light.at<cv::Vec3f>(y, x) / most});
    }
  }
  if (places.empty()) return std::nullopt;
  const auto purest = places.begin() + static_cast<std::ptrdiff_t>((places.size() + 3) / 4);
  std::nth_element(places.begin(), purest - 1, places.end(),
                   [](const Place& a, const Place& b) { return a.purity > b.purity; });
  places.erase(purest, places.end());
  RoomColor result;
  for (int c = 0; c < 3; ++c) {
    std::vector<float> ratios;
    for (const Place& place : places) ratios.push_back(place.ratio[c]);
    result.color[c] = upper_median(std::move(ratios));
  }
  const auto [least, most] = std::minmax_element(result.color.val, result.color.val + 3);
  result.color /= *most;
  std::vector<float> levels;
  for (const Place& place : places) levels.push_back(place.level);
  const auto high = levels.begin() + static_cast<std::ptrdiff_t>(levels.size() * 19 / 20);
  std::nth_element(levels.begin(), high, levels.end());
  result.most = *high / (*least / *most);
  return result;
}

cv::Mat disk(double pitch_px) {
  const int size = 2 * (nearest(static_cast<float>(usable_pitch(pitch_px))) / 2) + 1;
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {size, size});
}

}  // namespace

bool lines_lack_a_channel(const std::vector<ColorFamily>& families) {
  constexpr double kLacking = 0.2;  // of the brightest channel; less than kOwn
  for (const ColorFamily& family : families) {
    for (const PatternColor& color : family.colors) {
      const Rgb& rgb = color.light();
      const auto [least, most] = std::minmax_element(rgb.begin(), rgb.end());
      if (*least > kLacking * *most) return false;
    }
  }
  return true;
}

bool room_shows_prints(const cv::Mat& light, double pitch_px) {
  constexpr std::size_t kTiles = 24;
  // In the median tile. Lines alone have .09 at most, where they are closest to each other (of the
  // scenes of experiments/heldout.py); cloth with red, yellow, blue and white stripes .14 and more
  // in a room of two thirds of the lines' light, black and white cloth .27 in one of a third.
  constexpr float kShare = 0.13F;
  // In the median tile. Plain surfaces in such a room have .52 at most (bunny and bust, 1280x960,
  // .05 and .2 of the exposure; more where rims are in most tiles), stripes and chequers .75 and
  // more.
  constexpr float kContrast = 0.6F;
  if (!(pitch_px > 0)) return false;  // no rig that says where it stands
  const LitTiles lit = lit_tiles(of_channels(light).most);
  if (lit.tiles.empty()) return false;
  std::vector<float> shares;
  std::vector<float> contrasts;
  const std::size_t count = std::min(kTiles, lit.tiles.size());
  for (std::size_t k = 0; k < count; ++k) {
    const RoomInTile room = room_in_tile(light, lit.tiles[k * lit.tiles.size() / count],
                                         lit.brightest, piece_length(pitch_px));
    shares.push_back(room.share);
    contrasts.push_back(room.contrast);
  }
  return upper_median(std::move(shares)) > kShare && upper_median(std::move(contrasts)) > kContrast;
}

cv::Mat without_room_light(const cv::Mat& light, double pitch_px) {
  const int length = piece_length(pitch_px);
  const Extremes extremes = of_channels(light);
  const std::optional<RoomColor> room =
      color_of_room(light, extremes, along_pieces(extremes.least, length, kAllDirections),
                    lit_tiles(extremes.most).brightest);
  if (!room) return light;
  const cv::Vec3f& c = room->color;
  cv::Mat even;
  cv::divide(light, cv::Scalar(c[0], c[1], c[2]), even);
  const cv::Mat part =
      cv::min(along_pieces(of_channels(even).least, length, kAllDirections), room->most);
  std::array<cv::Mat, 3> of_room;
  for (int k = 0; k < 3; ++k) of_room[static_cast<std::size_t>(k)] = part * c[k];
  cv::Mat rest;
  cv::merge(of_room.data(), of_room.size(), rest);
  rest = light - rest;
  cv::Mat wide;
  cv::morphologyEx(rest, wide, cv::MORPH_OPEN, disk(pitch_px));
  return rest - wide;
}

}  // namespace pencilscan
