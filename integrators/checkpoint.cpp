#include "integrators/checkpoint.h"

#include <cstdio>
#include <fstream>

#include "core/error.h"
#include "core/fingerprint.h"
#include "core/image_write.h"
#include "integrators/iteration_films.h"

namespace nephroid {

namespace {

// Layout: magic, fingerprint, then each array as its length and its bytes, then a hash of all arrays.
constexpr char magic[8] = {'N', 'E', 'P', 'H', 'C', 'P', '0', '3'};

class Writer {
  public:
    explicit Writer(const std::string& path) : file_(path, std::ios::binary) {}
    template <class T>
    void value(const T& v) {
        file_.write(reinterpret_cast<const char*>(&v), sizeof(T));
    }
    template <class T>
    void array(const std::vector<T>& values) {
        value(static_cast<uint64_t>(values.size()));
        file_.write(reinterpret_cast<const char*>(values.data()),
                    static_cast<std::streamsize>(values.size() * sizeof(T)));
        hash_.add(values);
    }
    bool finish() {
        value(hash_.value());
        file_.close();
        return file_.good();
    }

  private:
    std::ofstream file_;
    Fingerprint hash_;
};

class Reader {
  public:
    explicit Reader(const std::string& path) : path_(path), file_(path, std::ios::binary) {
        if (!file_) throw Error(ExitCode::invalid_input, path + ": checkpoint: cannot be read; check the path");
    }
    template <class T>
    T value() {
        T v{};
        file_.read(reinterpret_cast<char*>(&v), sizeof(T));
        if (!file_) refuse("is truncated");
        return v;
    }
    /// Reads into an array whose size the settings have already fixed: a damaged length is noticed, not allocated.
    template <class T>
    void array(std::vector<T>& values) {
        if (value<uint64_t>() != values.size()) refuse("has another size");
        file_.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(values.size() * sizeof(T)));
        if (!file_) refuse("is truncated");
        hash_.add(values);
    }
    /// Reads an array whose size only the file knows.
    void array_of_any_size(std::vector<uint8_t>& values) {
        const auto size = value<uint64_t>();
        const auto position = file_.tellg();
        file_.seekg(0, std::ios::end);
        if (size > static_cast<uint64_t>(file_.tellg() - position)) refuse("is truncated");
        file_.seekg(position);
        values.resize(size);
        file_.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(size));
        hash_.add(values);
    }
    void finish() {
        if (value<uint64_t>() != hash_.value()) refuse("is damaged");
    }
    [[noreturn]] void refuse(const std::string& what) const {
        throw Error(ExitCode::resume_mismatch, path_ + ": checkpoint: " + what + "; render without --resume");
    }

  private:
    std::string path_;
    std::ifstream file_;
    Fingerprint hash_;
};

void write_film(Film& film, Writer& writer) {
    const Film::State state = film.state();
    for (const auto* sums : state.sums) writer.array(*sums);
    writer.array(*state.counts);
    writer.array(*state.nonfinite);
    for (const auto* digits : state.exact) writer.array(*digits);
}

void read_film(Film& film, Reader& reader) {
    const Film::State state = film.state();
    for (auto* sums : state.sums) reader.array(*sums);
    reader.array(*state.counts);
    reader.array(*state.nonfinite);
    for (auto* digits : state.exact) reader.array(*digits);
}

size_t tile_count(const Film& film) {
    const auto tiles = [](int begin, int end) { return (end - 1) / tile_size - begin / tile_size + 1; };
    const PixelRegion& crop = film.crop();
    return static_cast<size_t>(tiles(crop.x0, crop.x1)) * static_cast<size_t>(tiles(crop.y0, crop.y1));
}

}  // namespace

void save_checkpoint(const std::string& path, uint64_t fingerprint, Film& film, const CheckpointData& data) {
    const std::string temporary = temporary_path(path);
    Writer writer(temporary);
    writer.value(magic);
    writer.value(fingerprint);
    writer.value(data.render_seconds);
    writer.value(data.rays);
    writer.array(data.tile_samples);
    writer.value(data.last_lesson);
    writer.array(data.learned);
    write_film(film, writer);
    writer.value(static_cast<uint32_t>(data.earlier_films.size()));
    for (Film earlier : data.earlier_films) write_film(earlier, writer);
    if (!writer.finish()) {
        std::remove(temporary.c_str());
        throw Error(ExitCode::output_failed, path + ": checkpoint: cannot be written; check space and permissions");
    }
    commit_file(temporary, path);
}

CheckpointData load_checkpoint(const std::string& path, uint64_t fingerprint, Film& film) {
    Reader reader(path);
    struct Magic {
        char bytes[8];
    };
    const Magic found = reader.value<Magic>();
    if (std::string(found.bytes, 8) != std::string(magic, 8)) reader.refuse("is not a checkpoint of this version");
    if (reader.value<uint64_t>() != fingerprint) reader.refuse("belongs to another scene or other settings");
    CheckpointData data;
    data.render_seconds = reader.value<double>();
    data.rays = reader.value<uint64_t>();
    data.tile_samples.resize(tile_count(film));
    reader.array(data.tile_samples);
    data.last_lesson = reader.value<uint32_t>();
    reader.array_of_any_size(data.learned);
    read_film(film, reader);
    const auto earlier_films = reader.value<uint32_t>();
    if (earlier_films >= IterationFilms::most_combined) reader.refuse("is damaged");
    for (uint32_t i = 0; i < earlier_films; ++i) {
        data.earlier_films.push_back(film);
        read_film(data.earlier_films.back(), reader);
    }
    reader.finish();
    return data;
}

}  // namespace nephroid
