// Values to bytes and back, for state that checkpoints keep. The reader trusts its bytes: their hash has been checked.
#pragma once

#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>
#include <vector>

namespace nephroid {

class ByteWriter {
  public:
    template <class T>
    void value(const T& v) {
        static_assert(std::is_trivially_copyable_v<T>);
        append(&v, sizeof(T));
    }
    template <class T>
    void array(const std::vector<T>& values) {
        static_assert(std::is_trivially_copyable_v<T>);
        value(static_cast<uint64_t>(values.size()));
        append(values.data(), values.size() * sizeof(T));
    }
    std::vector<uint8_t> take() { return std::move(bytes_); }

  private:
    void append(const void* data, size_t size) {
        const auto* first = static_cast<const uint8_t*>(data);
        bytes_.insert(bytes_.end(), first, first + size);
    }
    std::vector<uint8_t> bytes_;
};

class ByteReader {
  public:
    explicit ByteReader(const std::vector<uint8_t>& bytes) : next_(bytes.data()) {}
    template <class T>
    T value() {
        T v{};
        extract(&v, sizeof(T));
        return v;
    }
    template <class T>
    void array(std::vector<T>& values) {
        values.resize(value<uint64_t>());
        extract(values.data(), values.size() * sizeof(T));
    }

  private:
    void extract(void* to, size_t size) {
        if (size == 0) return;
        std::memcpy(to, next_, size);
        next_ += size;
    }
    const uint8_t* next_;
};

}  // namespace nephroid
