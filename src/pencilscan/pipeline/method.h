#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "pencilscan/joint/joint.h"
#include "pencilscan/paper/components.h"

namespace pencilscan {

/// The paper's A has nothing to choose.
struct LinearOptions {};

/// Which solution method, and its own options.
using MethodOptions =
    std::variant<JointOptions, MultiviewOptions, LinearOptions, SingleProjectorOptions>;

/// What the way of a frame asks of a method.
struct MethodCapabilities {
  bool needs_identities = false;    ///< projector and local ID of each curve, decided before
  bool may_be_guided = false;       ///< decides lines: surfaces may confirm, complete and smooth it
  bool allows_dense_depth = false;  ///< its planes are the projected lines, not between them
  bool corrects_rig = false;        ///< crossings that miss each other tell how the rig is off
  bool needs_grid = false;          ///< some projector must show lines of both orientations
};

/// A way to decide the line of every curve from the grid graphs of all cameras.
struct SolutionMethod {
  std::string_view name;  ///< on the command line
  MethodCapabilities capabilities;
  MethodOptions defaults;
  Labeling (*solve)(const Rig& rig, const std::vector<ColorFamily>& families,
                    std::span<const GridGraph> graphs, const MethodOptions& options);
};

/// All methods, in the order in which people are told of them.
[[nodiscard]] std::span<const SolutionMethod> solution_methods();
/// The method that these options are of.
[[nodiscard]] const SolutionMethod& solution_method(const MethodOptions& options);
/// The same.
[[nodiscard]] std::vector<std::string> method_names();
/// Nothing for a name that no method has.
[[nodiscard]] const SolutionMethod* find_method(std::string_view name);

/// Sets the multi-view cost, published or normalized; methods without one stay as they are. False
/// for another name.
[[nodiscard]] bool set_multiview_cost(std::string_view name, MethodOptions& options);

/// The rule for `projectors` that the rig breaks for this method; empty: none.
[[nodiscard]] std::string_view broken_rule(const Rig& rig, const MethodOptions& options);

}  // namespace pencilscan
