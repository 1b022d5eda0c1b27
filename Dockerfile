# The page to design on, at the address that it prints:
#   docker build -t blast-env .
#   mkdir -p designs
#   docker run --rm --user "$(id -u)" -p 127.0.0.1:8080:8080 -v "$PWD/designs:/designs" blast-env
FROM python:3.11-slim-bookworm

# WeasyPrint, which writes reports as PDF, needs Pango.
RUN apt-get update \
    && apt-get install --no-install-recommends -y libpango-1.0-0 libpangoft2-1.0-0 libharfbuzz-subset0 \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /src
COPY pyproject.toml hatch_build.py constraints.txt README.md LICENSE ./
COPY blast_env_command.py ./
COPY blast_env blast_env
COPY agents agents
COPY scenarios scenarios
RUN pip install --no-cache-dir -c constraints.txt ".[app]" && rm -rf /src

RUN useradd --create-home designer && install -d -o designer /designs
USER designer
WORKDIR /designs
# Whoever --user says can write what Numba and matplotlib keep.
ENV HOME=/tmp SDL_VIDEODRIVER=dummy PYGAME_HIDE_SUPPORT_PROMPT=1
EXPOSE 8080
# Nothing is encrypted: publish the port at 127.0.0.1, as above, or behind something that does it.
CMD ["blast-env", "app", "--host", "0.0.0.0", "--port", "8080", "--folder", "/designs"]
