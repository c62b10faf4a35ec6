/* SPDX-License-Identifier: Apache-2.0 */
#include "client/frames.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

/* Memory that is kept for the next message; more, needed for a long one, is freed. */
#define KEPT_MAX ((size_t)64 * 1024)

int db_frames_add(struct db_frames *frames, const void *bytes, size_t count)
{
	size_t size = frames->size > 0 ? frames->size : 4096;
	char *grown;

	if (frames->begin > 0) {
		frames->end -= frames->begin;
		frames->searched -= frames->begin;
		memmove(frames->bytes, frames->bytes + frames->begin, frames->end);
		frames->begin = 0;
	}
	if (frames->end + count > frames->size) {
		while (size < frames->end + count)
			size *= 2;
		grown = realloc(frames->bytes, size);
		if (!grown)
			return -ENOMEM;
		frames->bytes = grown;
		frames->size = size;
	}
	memcpy(frames->bytes + frames->end, bytes, count);
	frames->end += count;
	return 0;
}

int db_frames_take(struct db_frames *frames, json_t **message)
{
	const char *begin;
	const char *end;

	if (frames->searched == frames->end)
		return 0;
	begin = frames->bytes + frames->begin;
	end = memchr(frames->bytes + frames->searched, '\0', frames->end - frames->searched);
	if (!end) {
		frames->searched = frames->end;
		return frames->end - frames->begin > frames->limit ? -EMSGSIZE : 0;
	}
	frames->begin += (size_t)(end - begin) + 1;
	frames->searched = frames->begin;
	*message = json_loadb(begin, (size_t)(end - begin), JSON_REJECT_DUPLICATES, NULL);
	if (frames->begin == frames->end && frames->size > KEPT_MAX) {
		free(frames->bytes);
		*frames = (struct db_frames){ .limit = frames->limit };
	}
	if (json_is_object(*message))
		return 1;
	json_decref(*message);
	*message = NULL;
	return -EBADMSG;
}

char *db_frames_write_call(const char *method, const json_t *parameters, const char *flag,
                           size_t *size)
{
	json_t *call = json_pack("{s:s}", "method", method);
	char *text = NULL;
	int failed = call ? 0 : -1;

	if (!failed && parameters)
		failed = json_object_set_new(call, "parameters", json_deep_copy(parameters));
	if (!failed && flag)
		failed = json_object_set_new(call, flag, json_true());
	if (!failed)
		text = json_dumps(call, JSON_COMPACT);
	json_decref(call);
	*size = text ? strlen(text) + 1 : 0;
	return text;
}
