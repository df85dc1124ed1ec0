#include "integrators/iteration_films.h"

namespace nephroid {

IterationFilms::IterationFilms(Film& current, EarlierSamples earlier) : current_(current), earlier_(earlier) {
    if (earlier == EarlierSamples::combined) current.keep_squares();
}

void IterationFilms::begin_iteration() {
    if (earlier_ == EarlierSamples::kept) return;
    const size_t most = earlier_ == EarlierSamples::combined ? most_combined - 1 : 1;
    if (earlier_films_.size() == most) earlier_films_.erase(earlier_films_.begin());
    earlier_films_.push_back(current_);
    current_.clear();
}

Film IterationFilms::picture() const {
    return earlier_ == EarlierSamples::combined ? combined() : longest();
}

// The number of samples decides, not what they are: that would be a bias. The newer of equals.
const Film& IterationFilms::longest() const {
    const Film* best = &current_;
    for (auto film = earlier_films_.rbegin(); film != earlier_films_.rend(); ++film) {
        if (film->min_spp() > best->min_spp()) best = &*film;
    }
    return *best;
}

// The inverse variance of a film's mean, for one weight per film, is the inverse of its samples' variance for each of
// its samples. Films that do not know theirs yet (below two samples) or have none (black) are left out.
Film IterationFilms::combined() const {
    std::vector<const Film*> films;
    std::vector<double> weights;
    const auto add = [&](const Film& film) {
        const double variance = film.min_spp() >= 2 ? film.sample_variance() : 0.0;
        if (!(variance > 0.0)) return;
        films.push_back(&film);
        weights.push_back(1.0 / variance);
    };
    for (const Film& film : earlier_films_) add(film);
    add(current_);
    return films.empty() ? longest() : Film::combine(films, weights);
}

}  // namespace nephroid
