/* Marks what a shared library shows. */
#ifndef DPR_EXPORT_H
#define DPR_EXPORT_H

#define DPR_API __attribute__((visibility("default")))

#endif
