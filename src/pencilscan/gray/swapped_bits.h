#pragma once

#include <string>

#include "pencilscan/gray/gray_decode.h"

namespace pencilscan {

/// Two bits of one axis whose pictures were exchanged, in words such as "those of column bits 6 and
/// 7 are exchanged (004, 005 and 006, 007)"; empty when the bits fit each other or no exchange
/// makes them.
///
/// Between neighbouring pixels whose codes differ in one bit the panel coordinate goes on by one,
/// or by what a steep surface makes of it. A bit that is read in another's place makes it jump.
/// Codes stay smooth between these places, so explain_wrong_order() does not see them. Bits are
/// wrong where most such neighbours jump, and an exchange explains it where then no bit is.
[[nodiscard]] std::string explain_swapped_bits(const GrayStack& stack, const DecodedView& decoded,
                                               const GrayDecodeOptions& options = {});

}  // namespace pencilscan
