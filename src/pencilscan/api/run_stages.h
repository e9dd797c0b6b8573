#pragma once

#include <functional>
#include <span>
#include <string_view>

#include "pencilscan/api/reconstruct.h"
#include "pencilscan/core/progress.h"

namespace pencilscan {

/// Runs `work`, which announces its stages by the Progress it is given, in a thread of its own,
/// while this thread tells `listener`. Without a listener `work` runs in this thread. `stages`:
/// those that count, in order. Rethrows what `work` or `listener` throws.
void run_stages(const StageListener& listener, std::span<const std::string_view> stages,
                const std::function<void(const Progress&)>& work);

}  // namespace pencilscan
