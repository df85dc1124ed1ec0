#include "apps/render/process.h"

#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <ctime>
#include <fstream>
#include <sstream>
#include <string>

#include "integrators/driver.h"

namespace nephroid {

std::chrono::steady_clock::time_point process_start_time() {
    const auto now = std::chrono::steady_clock::now();
    // Field 22 of /proc/self/stat is the start time in clock ticks since boot; the name in field 2 may hold spaces.
    std::ifstream file("/proc/self/stat");
    std::string line;
    std::getline(file, line);
    const size_t name_end = line.rfind(')');
    if (name_end == std::string::npos) return now;
    std::istringstream fields(line.substr(name_end + 1));
    std::string skipped;
    for (int field = 3; field < 22; ++field) fields >> skipped;
    double ticks = 0.0;
    timespec uptime{};
    if (!(fields >> ticks) || clock_gettime(CLOCK_BOOTTIME, &uptime) != 0) return now;
    const double started = ticks / static_cast<double>(sysconf(_SC_CLK_TCK));
    const double age = static_cast<double>(uptime.tv_sec) + 1e-9 * static_cast<double>(uptime.tv_nsec) - started;
    if (!(age > 0.0 && age < 60.0)) return now;  // A container may show another boot time.
    return now - std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(age));
}

uint64_t peak_resident_bytes() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<uint64_t>(usage.ru_maxrss) * 1024;
}

void install_interrupt_handlers() {
    struct sigaction action {};
    action.sa_handler = [](int) { interrupt_requested = true; };
    action.sa_flags = static_cast<int>(SA_RESETHAND);
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
}

}  // namespace nephroid
