/* SPDX-License-Identifier: Apache-2.0 */
/* The files of an authority, NAME.pem in its folder. Errors are printed. */
#ifndef DRIVEBRIDGE_AUTHORITY_FILES_H
#define DRIVEBRIDGE_AUTHORITY_FILES_H

#include "certificates/certificate.h"

#include <stdbool.h>
#include <stddef.h>

/* What a file is to have, and who may read it. */
struct db_authority_text {
	const unsigned char *bytes;
	size_t size;
	/* null: everybody; "": its owner only; else its owner and this group, where there is one */
	const char *group;
};

/* The file exists completely or not at all. Unless it may be replaced, one that is there is an
 * error. */
bool db_authority_write(const char *folder, const char *name, const struct db_authority_text *text,
                        bool replace);

/* To be cleared in any case. */
bool db_authority_read(const char *folder, const char *name, struct db_certificate_file *file);

#endif
