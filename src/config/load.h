/* SPDX-License-Identifier: Apache-2.0 */
/* Configurations from texts; from files it is db_config_load(). */
#ifndef DRIVEBRIDGE_CONFIG_LOAD_H
#define DRIVEBRIDGE_CONFIG_LOAD_H

#include "config/section.h"

/* The families and transports of this program. */
extern const struct db_built_in db_load_built_in;

/* As db_config_load(), from a text that messages name `file`. */
int db_load_text(const char *text, const char *file, FILE *errors, struct db_config **config);

/* As db_config_load(), from sources with their texts, which it takes over. */
int db_load_sources(struct db_source *sources, size_t count, FILE *errors,
                    struct db_config **config);

/* With other families and transports than this program's: they must outlive the configuration. */
int db_load_text_with(const struct db_built_in *built_in, const char *text, const char *file,
                      FILE *errors, struct db_config **config);

#endif
