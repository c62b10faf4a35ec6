/* SPDX-License-Identifier: Apache-2.0 */
#include "fakes/places.h"

#include "fakes/must.h"

struct db_request *fake_place_fill(struct fake_place *places, size_t count,
                                   const struct db_request *request)
{
	struct fake_place *place = places;

	must(request->setting_count <= DB_SETTINGS_MAX);
	while (place < places + count && place->used)
		place++;
	if (place == places + count)
		return NULL;
	place->used = true;
	place->request = *request;
	if (request->setting_count > 0) {
		for (size_t i = 0; i < request->setting_count; i++)
			place->settings[i] = request->settings[i];
		place->request.settings = place->settings;
	} else {
		place->args = request->args ? *request->args : (struct db_args){ 0 };
		place->request.args = &place->args;
	}
	return &place->request;
}

struct db_request *fake_place_find(struct fake_place *places, size_t count, uint32_t ticket)
{
	for (size_t i = 0; i < count; i++) {
		if (places[i].used && places[i].request.ticket == ticket)
			return &places[i].request;
	}
	return NULL;
}

struct db_request *fake_place_end(struct db_request *request, enum db_result result, db_time now)
{
	request->result = (uint8_t)result;
	request->finished = now;
	return request;
}

void fake_place_release(struct fake_place *places, size_t count, const struct db_request *request)
{
	for (size_t i = 0; i < count; i++) {
		if (&places[i].request == request)
			places[i] = (struct fake_place){ .used = false };
	}
}
