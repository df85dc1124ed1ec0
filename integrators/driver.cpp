#include "integrators/driver.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <mutex>

#include "core/error.h"
#include "integrators/checkpoint.h"
#include "integrators/iteration_films.h"

namespace nephroid {

std::atomic<bool> interrupt_requested{false};

namespace {

using Clock = std::chrono::steady_clock;

double seconds_between(Clock::time_point from, Clock::time_point to) {
    return std::chrono::duration<double>(to - from).count();
}

/// A thread's integrator state and sample buffer.
struct ThreadState {
    std::unique_ptr<IntegratorWorker> worker;
    SampleBuffer samples;
};

uint32_t block_start(uint32_t sample) {
    return sample < 2 ? sample
                      : (sample < max_samples_per_block ? 2 : sample / max_samples_per_block * max_samples_per_block);
}

class RenderLoop {
  public:
    RenderLoop(const Integrator& integrator, Film& film, const DriverSettings& settings, Progress& progress)
        : film_(film),
          learner_(integrator.learner()),
          films_(film, learner_ != nullptr ? learner_->earlier_samples() : EarlierSamples::kept),
          settings_(settings),
          progress_(progress),
          start_(Clock::now()),
          states_([&integrator] {
              return ThreadState{integrator.make_worker(), SampleBuffer()};
          }) {
        const PixelRegion& crop = film.crop();
        for (int y = crop.y0 / tile_size * tile_size; y < crop.y1; y += tile_size) {
            for (int x = crop.x0 / tile_size * tile_size; x < crop.x1; x += tile_size) {
                tiles_.push_back(make_tile_block(x, y, film.image_width(), film.image_height()));
            }
        }
        data_.tile_samples.assign(tiles_.size(), 0);
        if (settings.seconds) {
            deadline_ =
                settings.process_start + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(
                                             std::max(*settings.seconds - settings.reserved_seconds, 0.0)));
        }
    }

    RenderResult run() {
        resume();
        last_checkpoint_ = Clock::now();
        plan_lesson();
        take_lesson();
        while (result_.stop_reason.empty()) {
            render_pass(next_pass_end());
            take_lesson();
            finish_pass();
        }
        if (!settings_.checkpoint.empty()) checkpoint();
        if (learner_ != nullptr) film_ = films_.picture();
        result_.render_seconds = elapsed();
        result_.rays = rays();
        return result_;
    }

  private:
    double elapsed() const { return data_.render_seconds + seconds_between(start_, Clock::now()); }
    uint64_t rays() {
        uint64_t total = data_.rays;
        for (const ThreadState& state : states_) total += state.worker->rays();
        return total;
    }
    uint32_t first_unfinished() const {
        return *std::min_element(data_.tile_samples.begin(), data_.tile_samples.end());
    }
    /// Of every pixel, that its film does not hold any more.
    double samples_before_film() const {
        const bool cleared = learner_ != nullptr && learner_->earlier_samples() != EarlierSamples::kept;
        return cleared ? data_.last_lesson : 0.0;
    }
    bool past_deadline() const { return deadline_ && Clock::now() >= *deadline_; }

    void resume() {
        if (!settings_.resume || !std::filesystem::exists(settings_.checkpoint)) return;
        data_ = load_checkpoint(settings_.checkpoint, settings_.fingerprint, film_);
        this_run_first_ = first_unfinished();
        if (learner_ != nullptr) {
            // Nothing was, where a time limit had left nothing to learn about.
            if (!data_.learned.empty()) learner_->restore(data_.learned);
            films_.earlier() = std::move(data_.earlier_films);
        }
        progress_.verbose("resumed at " + std::to_string(film_.min_spp()) + " spp");
    }

    // When to learn next. A lesson must be worth its while: it is left out where fewer samples would follow it than
    // came before it, as far as spp or the time can tell (Mueller et al. 2017). A resumed render may be past
    // lessons that a smaller limit had left out.
    void plan_lesson() {
        lesson_.reset();
        if (learner_ == nullptr) return;
        const uint32_t done = first_unfinished();
        lesson_ = learner_->next_lesson(data_.last_lesson);
        while (lesson_ && *lesson_ < done) lesson_ = learner_->next_lesson(*lesson_);
        if (lesson_ && !is_worth_while(*lesson_, done)) lesson_.reset();
        learner_->expect_lesson(lesson_.has_value());
    }

    bool is_worth_while(uint32_t lesson, uint32_t done) const {
        if (settings_.spp && *settings_.spp / 2 < lesson) return false;
        if (!deadline_) return true;
        const double before = lesson - done, after = lesson;
        return seconds_between(Clock::now(), *deadline_) >= seconds_per_sample_ * (before + after);
    }

    void take_lesson() {
        if (!lesson_ || first_unfinished() < *lesson_ || past_deadline()) return;
        const uint32_t samples = *lesson_ - data_.last_lesson;
        // A resumed render has traced some of them in an earlier run, or all.
        const uint32_t traced = *lesson_ - std::max(data_.last_lesson, this_run_first_);
        if (traced > 0) seconds_per_sample_ = (run_seconds_ - seconds_at_lesson_) / traced;
        seconds_at_lesson_ = run_seconds_;
        learner_->learn(samples);
        films_.begin_iteration();
        data_.last_lesson = *lesson_;
        plan_lesson();
    }

    // Passes take about a tenth of the time so far, within [0.2, 2] seconds: short enough to stop on a signal and to
    // draw an error curve, long enough to keep all threads busy.
    uint32_t next_pass_end() {
        const uint32_t done = first_unfinished();
        const uint32_t limit =
            std::min(settings_.spp.value_or(std::numeric_limits<uint32_t>::max()), lesson_.value_or(~0U));
        uint32_t samples = samples_in_block(block_start(done));
        if (done > this_run_first_ && run_seconds_ > 0.0) {
            const double wanted = std::clamp(0.1 * run_seconds_, 0.2, 2.0);
            const double per_sample = run_seconds_ / static_cast<double>(done - this_run_first_);
            samples = static_cast<uint32_t>(std::clamp(wanted / per_sample, 1.0, 1e6));
        }
        // Passes end between blocks, so that no block is traced twice.
        const uint32_t end = block_start(done + samples);
        return std::min(limit, end > done ? end : block_start(done) + samples_in_block(block_start(done)));
    }

    void render_pass(uint32_t end) {
        if (first_pass_) this_run_first_ = first_unfinished();
        const Clock::time_point begin = Clock::now();
        pass_first_ = first_unfinished();
        pass_end_ = end;
        tiles_done_ = 0;
        tbb::task_arena arena(settings_.threads);
        arena.execute([&] {
            tbb::parallel_for(
                tbb::blocked_range<size_t>(0, tiles_.size(), 1),
                [&](const tbb::blocked_range<size_t>& range) {
                    for (size_t i = range.begin(); i < range.end(); ++i) render_tile(i, end);
                },
                tbb::simple_partitioner());
        });
        run_seconds_ += seconds_between(begin, Clock::now());
        first_pass_ = false;
    }

    void render_tile(size_t tile, uint32_t end) {
        ThreadState& state = states_.local();
        SampleBlock block = tiles_[tile];
        uint32_t& next = data_.tile_samples[tile];
        while (next < end) {
            // A picture with holes is worth nothing: only the first sample of every pixel ignores the deadline.
            if (next > 0 && past_deadline()) return;
            block.first_sample = block_start(next);
            block.sample_count = samples_in_block(block.first_sample);
            state.worker->render(block, state.samples);
            const uint32_t skip = next - block.first_sample;
            const uint32_t take = std::min(block.sample_count - skip, end - next);
            film_.add(block, skip, take, state.samples);
            next += take;
        }
        report_tile();
    }

    void report_tile() {
        const size_t done = ++tiles_done_;
        if (!progress_mutex_.try_lock()) return;
        const std::lock_guard lock(progress_mutex_, std::adopt_lock);
        const double pass_share = static_cast<double>(done) / static_cast<double>(tiles_.size());
        progress_.update(share(pass_first_ + pass_share * (pass_end_ - pass_first_)), pass_number(), pass_first_,
                         noise_);
    }

    /// Share of the whole render, by the limit that is nearest.
    double share(double samples) const {
        double result = 0.0;
        if (settings_.spp) result = std::max(result, samples / *settings_.spp);
        if (settings_.seconds) {
            result = std::max(result, seconds_between(settings_.process_start, Clock::now()) / *settings_.seconds);
        }
        if (settings_.noise && noise_ && *noise_ > 0.0) {
            result = std::max(result, std::pow(*settings_.noise / *noise_, 2.0));
        }
        return std::min(result, 1.0);
    }

    uint32_t pass_number() const { return static_cast<uint32_t>(result_.passes.size()) + 1; }

    void finish_pass() {
        const bool measured = settings_.noise || !settings_.reference.empty();
        std::optional<Film> combined;
        if (learner_ != nullptr && measured) combined = films_.picture();
        const Film& picture = combined ? *combined : film_;
        if (settings_.noise) noise_ = picture.relative_noise();
        PassRecord record;
        const auto pixels = static_cast<double>(film_.crop().width()) * static_cast<double>(film_.crop().height());
        record.spp = samples_before_film() + static_cast<double>(film_.sample_count()) / pixels;
        record.seconds = seconds_between(settings_.process_start, Clock::now());
        if (!settings_.reference.empty()) record.error = compare_images(picture.beauty(), settings_.reference);
        result_.passes.push_back(record);

        const uint32_t done = first_unfinished();
        if (interrupt_requested) {
            result_.stop_reason = "interrupted";
        } else if (settings_.spp && done >= *settings_.spp) {
            result_.stop_reason = "spp";
        } else if (past_deadline()) {
            result_.stop_reason = "time";
        } else if (settings_.noise && done >= 8 && *noise_ <= *settings_.noise) {
            result_.stop_reason = "noise";
        } else if (!settings_.checkpoint.empty() &&
                   seconds_between(last_checkpoint_, Clock::now()) >= settings_.checkpoint_every) {
            checkpoint();
        }
    }

    void checkpoint() {
        CheckpointData data = data_;
        if (learner_ != nullptr) {
            data.learned = learner_->state();
            data.earlier_films = films_.earlier();
        }
        data.render_seconds = elapsed();
        data.rays = rays();
        save_checkpoint(settings_.checkpoint, settings_.fingerprint, film_, data);
        last_checkpoint_ = Clock::now();
    }

    Film& film_;  // Of the samples since the last lesson, unless earlier ones are kept there.
    Learner* learner_;
    IterationFilms films_;
    const DriverSettings& settings_;
    Progress& progress_;
    Clock::time_point start_;
    std::optional<Clock::time_point> deadline_;
    tbb::enumerable_thread_specific<ThreadState> states_;
    std::vector<SampleBlock> tiles_;
    CheckpointData data_;
    RenderResult result_;

    double run_seconds_ = 0.0;         // Inside passes, this run only.
    std::optional<uint32_t> lesson_;   // Sample count of the next one.
    double seconds_at_lesson_ = 0.0;   // run_seconds_ at the last lesson.
    double seconds_per_sample_ = 0.0;  // Before the last lesson; 0: not known.
    uint32_t this_run_first_ = 0;
    bool first_pass_ = true;
    uint32_t pass_first_ = 0;
    uint32_t pass_end_ = 0;
    std::atomic<size_t> tiles_done_{0};
    std::mutex progress_mutex_;
    std::optional<double> noise_;
    Clock::time_point last_checkpoint_;
};

}  // namespace

RenderResult run_render(const Integrator& integrator, Film& film, const DriverSettings& settings, Progress& progress) {
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                      static_cast<size_t>(settings.threads));
    if (integrator.makes_splats()) film.expect_splats();
    return RenderLoop(integrator, film, settings, progress).run();
}

}  // namespace nephroid
