#pragma once

/// Marks what libdtact.so shows of itself: its own functions and classes are hidden otherwise.
#define DTACT_EXPORT [[gnu::visibility("default")]]
