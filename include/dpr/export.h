/* Marks what a shared library shows: functions and classes of the public headers, and of these not the state
 * behind them. Errors are among the classes, so that an exception is the same type on both sides. */
#ifndef DPR_EXPORT_H
#define DPR_EXPORT_H

#define DPR_API __attribute__((visibility("default")))
#define DPR_LOCAL __attribute__((visibility("hidden")))

#endif
