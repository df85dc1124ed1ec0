// Facts about this process that the operating system knows.
#pragma once

#include <chrono>
#include <cstdint>

namespace nephroid {

/// When the process was started, before the loader and static constructors ran: --time counts from there.
std::chrono::steady_clock::time_point process_start_time();

/// Largest resident set so far, bytes.
uint64_t peak_resident_bytes();

/// SIGINT and SIGTERM request a graceful stop; a second one kills.
void install_interrupt_handlers();

}  // namespace nephroid
