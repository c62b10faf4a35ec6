/* SPDX-License-Identifier: Apache-2.0 */
/* Values to Modbus registers and back: types and word order. Pure. */
#ifndef DRIVEBRIDGE_REGMAP_WORDS_H
#define DRIVEBRIDGE_REGMAP_WORDS_H

#include "regmap/index.h"

/* The longest text: configuration_message. */
#define DB_CELL_REGISTERS_MAX 80

/* Writes the cell's registers, as they are in the image, to words[]. */
void db_words_encode(const struct db_cell *cell, const void *image, bool low_first,
                     uint16_t *words);

/* The value that a cell's registers stand for. False when a float is not finite. */
bool db_words_decode(const struct db_cell *cell, const uint16_t *words, bool low_first,
                     union db_value *value);

/* Puts a value into an image's member of the cell's type. */
void db_words_store(const struct db_cell *cell, union db_value value, void *image);

#endif
