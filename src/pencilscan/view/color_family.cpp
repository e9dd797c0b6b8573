#include "pencilscan/view/color_family.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "pencilscan/pattern/color_likeness.h"

namespace pencilscan {
namespace {

Vec3 vector_of(const PatternColor& color) {
  const Rgb& rgb = color.light();
  return {rgb[0], rgb[1], rgb[2]};
}

/// Least-squares, minimum-norm weights that are 1 on own colours and 0 on the others.
void set_presence(std::vector<ColorFamily>& families) {
  for (ColorFamily& own : families) {
    std::vector<Vec3> rows;
    std::vector<double> targets;
    for (const ColorFamily& family : families) {
      for (const PatternColor& color : family.colors) {
        rows.push_back(vector_of(color));
        targets.push_back(&family == &own ? 1 : 0);
      }
    }
    Eigen::MatrixXd A(static_cast<Eigen::Index>(rows.size()), 3);
    Eigen::VectorXd b(A.rows());
    for (Eigen::Index i = 0; i < A.rows(); ++i) {
      A.row(i) = rows[static_cast<std::size_t>(i)].transpose();
      b(i) = targets[static_cast<std::size_t>(i)];
    }
    own.presence = A.completeOrthogonalDecomposition().solve(b);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (targets[i] == 0) own.leakage = std::max(own.leakage, std::abs(own.presence.dot(rows[i])));
    }
  }
}

}  // namespace

std::vector<int> ColorFamily::color_of_symbol(const LinePattern& pattern) const {
  std::vector<int> index;
  for (const PatternColor& color : pattern.colors) index.push_back(likeliest_color(color, colors));
  return index;
}

std::vector<ColorFamily> color_families(const Rig& rig) {
  std::vector<ColorFamily> families;
  for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
    for (std::size_t k = 0; k < rig.projectors[p].patterns.size(); ++k) {
      std::vector<PatternColor> colors = rig.projectors[p].patterns[k].colors;
      std::sort(colors.begin(), colors.end());
      auto family = std::find_if(families.begin(), families.end(), [&](const ColorFamily& f) {
        return f.colors == colors || paired_colors(colors, f.colors).has_value();
      });
      if (family == families.end()) {
        family = families.insert(family, ColorFamily());
        family->colors = colors;
      }
      family->patterns.push_back({static_cast<int>(p), static_cast<int>(k)});
    }
  }
  set_presence(families);
  return families;
}

int family_of(const std::vector<ColorFamily>& families, PatternRef pattern) {
  const auto found = std::find_if(families.begin(), families.end(), [&](const ColorFamily& f) {
    return std::find(f.patterns.begin(), f.patterns.end(), pattern) != f.patterns.end();
  });
  return found == families.end() ? -1 : static_cast<int>(found - families.begin());
}

Rig with_registered_patterns(Rig rig) {
  if (std::all_of(rig.projectors.begin(), rig.projectors.end(),
                  [](const Projector& p) { return p.color_registration.none(); }))
    return rig;
  for (const ColorFamily& family : color_families(rig)) {
    for (const PatternRef& ref : family.patterns) {
      Projector& projector = rig.projectors[static_cast<std::size_t>(ref.projector)];
      if (projector.color_registration.none()) continue;
      LinePattern& pattern = projector.patterns[static_cast<std::size_t>(ref.pattern)];
      pattern.max_lines = projector.line_count(pattern);
      Vec3 weight = Vec3::Zero();  // of red, green and blue in where its lines are found
      for (const PatternColor& color : pattern.colors)
        weight += family.presence.cwiseProduct(vector_of(color));
      weight /= weight.sum();
      const auto axis = static_cast<Eigen::Index>(pattern.axis);
      const auto model_position = [&](double px) {
        double mean = 0;
        for (std::size_t k = 0; k < 3; ++k)
          mean += weight[static_cast<Eigen::Index>(k)] *
                  projector.color_registration.from_color(k, projector, {px, px})[axis];
        return mean;
      };
      const double offset = model_position(pattern.offset_px);
      const double scale = model_position(pattern.offset_px + 1) - offset;
      pattern.offset_px = offset;
      pattern.pitch_px *= scale;
      pattern.line_width_px *= scale;
    }
  }
  for (Projector& projector : rig.projectors) projector.color_registration = {};
  return rig;
}

}  // namespace pencilscan
