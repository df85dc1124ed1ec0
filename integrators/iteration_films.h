// The films between lessons (Learner), and the picture that they make.
#pragma once

#include <cstdint>
#include <vector>

#include "core/film.h"
#include "integrators/learner.h"

namespace nephroid {

class IterationFilms {
  public:
    /// Films that a picture is made of, with EarlierSamples::combined: Mueller 2019.
    static constexpr size_t most_combined = 4;

    /// `current`, the film that samples come to, must outlive this.
    IterationFilms(Film& current, EarlierSamples earlier);
    /// After a lesson: what to do with the film so far.
    void begin_iteration();
    /// Without holes as soon as every pixel has had a sample, wherever the render stops.
    Film picture() const;

    /// Of earlier iterations, oldest first, for checkpoints.
    std::vector<Film>& earlier() { return earlier_films_; }

  private:
    const Film& longest() const;
    Film combined() const;

    Film& current_;
    EarlierSamples earlier_;
    std::vector<Film> earlier_films_;
};

}  // namespace nephroid
