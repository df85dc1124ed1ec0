// How failures and warnings travel: one exception type that carries the exit code, one list of warnings.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace nephroid {

/// Exit codes of `render`.
enum class ExitCode : int {
    done = 0,
    render_failed = 1,
    usage = 2,
    invalid_input = 3,
    output_failed = 4,
    resume_mismatch = 5,
    interrupted = 130,
};

/// A failure that ends the program with one line, `error: FILE: ELEMENT: what is wrong; what to do`.
class Error : public std::runtime_error {
  public:
    Error(ExitCode code, const std::string& line) : std::runtime_error(line), code_(code) {}
    ExitCode code() const { return code_; }

  private:
    ExitCode code_;
};

/// Things that were ignored or replaced while loading, one line each without the leading `warning: `.
using Warnings = std::vector<std::string>;

}  // namespace nephroid
