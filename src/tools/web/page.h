/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The files of the page: the content of a folder when the program starts, read into memory. Only
 * plain files of known types with plain names; a file NAME.gz next to NAME is its compressed form.
 * No request opens a file later.
 */
#ifndef DRIVEBRIDGE_WEB_PAGE_H
#define DRIVEBRIDGE_WEB_PAGE_H

#include <stddef.h>

struct db_web_file {
	char *name;
	const char *type; /* MIME type of its content */
	void *bytes;
	size_t size;
	void *packed; /* gzip; NULL: there is none */
	size_t packed_size;
	char etag[24];
};

struct db_web_page;

/* NULL with an error in the log. Freed with db_web_page_free(); NULL is allowed. */
struct db_web_page *db_web_page_load(const char *folder);
void db_web_page_free(struct db_web_page *page);

/* NULL: there is no file of this name. */
const struct db_web_file *db_web_page_find(const struct db_web_page *page, const char *name);

#endif
