// What stands behind the classes of the API, for the library, its programs and its tests.
#pragma once

namespace dpr {

/// Friend of the classes of the API.
struct Internals {
  template <class Object>
  static typename Object::Impl& of(const Object& object) {
    return *object.impl_;
  }
};

template <class Object>
typename Object::Impl& impl_of(const Object& object) {
  return Internals::of(object);
}

}  // namespace dpr
