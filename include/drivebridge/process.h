/* SPDX-License-Identifier: Apache-2.0 */
/* Another process, for messages. Any thread; reads /proc. */
#ifndef DRIVEBRIDGE_PROCESS_H
#define DRIVEBRIDGE_PROCESS_H

#include <sys/types.h>

#define DB_PROCESS_WORDS_MAX 48

/* "minicom (process 4711)"; "process 4711" where /proc does not show its name. */
void db_process_words(pid_t process, char text[DB_PROCESS_WORDS_MAX]);

#endif
