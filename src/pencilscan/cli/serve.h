#pragma once

#include "pencilscan/cli/interruption.h"
#include "pencilscan/server/page_server.h"

namespace pencilscan::cli {

/// Says where the page is and answers its requests until interrupted, or until the server gives up.
void serve(PageServer& server, Interruption& interruption);

}  // namespace pencilscan::cli
