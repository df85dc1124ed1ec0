// A 64-bit hash of data, to recognise the same scene and settings again. Not cryptographic.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

namespace nephroid {

class Fingerprint {
  public:
    void add_bytes(const void* data, size_t size) {
        const auto* bytes = static_cast<const unsigned char*>(data);
        add_word(size);
        for (; size >= 8; size -= 8, bytes += 8) {
            uint64_t word = 0;
            std::memcpy(&word, bytes, 8);
            add_word(word);
        }
        uint64_t rest = 0;
        std::memcpy(&rest, bytes, size);
        add_word(rest);
    }
    void add(const std::string& text) { add_bytes(text.data(), text.size()); }
    template <class T>
    void add(const std::vector<T>& values) {
        add_bytes(values.data(), values.size() * sizeof(T));
    }
    template <class T>
    void add_value(const T& value) {
        static_assert(std::is_arithmetic_v<T>);
        add_bytes(&value, sizeof(T));
    }
    uint64_t value() const { return hash_; }

  private:
    void add_word(uint64_t word) {
        // Multiply-xorshift: every bit of the word reaches every bit of the hash.
        hash_ = (hash_ ^ word) * 0x9fb21c651e98df25ULL;
        hash_ ^= hash_ >> 32;
    }
    uint64_t hash_ = 0x243f6a8885a308d3ULL;
};

}  // namespace nephroid
