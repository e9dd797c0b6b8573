#pragma once

namespace pencilscan {

/// The page of a laboratory (lab_page.html), whole.
extern const char* const kLabPage;

}  // namespace pencilscan
