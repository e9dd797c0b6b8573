#pragma once

#include <vector>

namespace pencilscan {

/// Lexicographically least de Bruijn sequence: every word of `order` symbols of {0..alphabet-1}
/// occurs once in the cyclic sequence of length alphabet^order. Built from Lyndon words
/// (Fredricksen, Kessler, Maiorana). alphabet >= 1, order >= 1, length <= 2^20.
[[nodiscard]] std::vector<int> de_bruijn_sequence(int alphabet, int order);

}  // namespace pencilscan
