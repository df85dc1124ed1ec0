// What every program of the project does the same way around its work: reads the command line, and turns errors into
// one line on stderr and an exit code.
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <new>
#include <string>

#include "core/error.h"

namespace nephroid {

/// False where only help or the version was asked for, and was printed. Throws Error(usage) with one line.
inline bool parse_command_line(CLI::App& app, int argc, char** argv) {
    try {
        app.parse(argc, argv);
    } catch (const CLI::Success& request) {
        app.exit(request);
        return false;
    } catch (const CLI::ParseError& error) {
        std::string what = error.what();
        std::replace(what.begin(), what.end(), '\n', ' ');
        throw Error(ExitCode::usage, "command line: " + what + "; see --help");
    }
    return true;
}

/// Exit code of `work`, a function that returns one; or of the error that it throws, printed. `memory_advice` says what
/// to do where memory runs out.
template <class Work>
int run_command(const char* program, const char* memory_advice, const Work& work) {
    ExitCode code = ExitCode::done;
    try {
        code = work();
    } catch (const Error& error) {
        std::fprintf(stderr, "error: %s\n", error.what());
        code = error.code();
    } catch (const std::bad_alloc&) {
        std::fprintf(stderr, "error: %s: out of memory; %s\n", program, memory_advice);
        code = ExitCode::render_failed;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "error: %s: %s; please report this\n", program, error.what());
        code = ExitCode::render_failed;
    }
    return static_cast<int>(code);
}

}  // namespace nephroid
